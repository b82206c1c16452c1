"""The manifest of a simulated data set, from the twin alone: the workflow needs it before anything is simulated."""

from __future__ import annotations

from typing import Any

import yaml

from vgyro.config import PARTIAL
from vgyro.dataset import Manifest
from vgyro.simulate.motion import plateaus_of
from vgyro.simulate.twin import ConstantRate, RandomRate, RateTable, Sinusoid, Twin, TwinRecording


def dump_name(recording: str) -> str:
    """File name of a recording's dump."""
    return f"{recording}.bin"


def reference_name(recording: TwinRecording) -> str | None:
    """File name of the logged rate of a recording; None where it stands still or the manifest gives a formula."""
    logged = isinstance(recording.motion, RandomRate) or recording.log_reference
    return f"{recording.name}_reference.parquet" if logged else None


def manifest_of(twin: Twin) -> Manifest:
    """The manifest of the data set that the twin makes."""
    record: dict[str, Any] = {
        "board": twin.board,
        "title": twin.title,
        "simulated": True,
        "twin": twin.name,
        "notes": twin.notes,
        "recordings": [_recording(recording) for recording in twin.recordings],
    }
    if twin.latitude_deg is not None:
        record["latitude_deg"] = twin.latitude_deg
    if twin.analysis is not None:
        record["analysis"] = twin.analysis.model_dump(mode="json", exclude_unset=True)
    return Manifest.model_validate(record, context={PARTIAL: True})


def manifest_yaml(manifest: Manifest) -> str:
    """The manifest as the text of a dataset.yaml."""
    record = manifest.model_dump(mode="json", exclude_unset=True)
    head = "# Written by `vgyro simulate`. The truth of every recording is in truth/.\n"
    return head + yaml.safe_dump(record, sort_keys=False, allow_unicode=True, width=120)


def _recording(recording: TwinRecording) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": recording.name, "kind": recording.kind, "files": dump_name(recording.name)}
    for key, value in (("rate_hz", recording.rate_hz), ("axis", recording.axis), ("reference", _reference(recording))):
        if value is not None:
            entry[key] = value
    return entry


def _reference(recording: TwinRecording) -> dict[str, Any] | None:
    motion = recording.motion
    file = reference_name(recording)
    if file is not None:
        return {"kind": "file", "file": file}
    match motion:
        case RateTable():
            return {"kind": "plateaus", "plateaus": [plateau.model_dump() for plateau in plateaus_of(motion)]}
        case ConstantRate():
            return {"kind": "constant", "rate": motion.rate}
        case Sinusoid():
            return motion.model_dump()
        case _:
            return None
