"""What new-dataset tells a person of the logs that it looked at: a line a finding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vgyro.cli.drafts.looking import LogLook
from vgyro.cli.drafts.manifest_text import ArrayDraft
from vgyro.storage.integrity import Integrity
from vgyro.storage.logs.names import bare_name


def array_lines(looks: Sequence[LogLook], array: ArrayDraft, together: bool) -> list[str]:
    """Files, time, gyros with their units, thermometers, and what is not used."""
    first = looks[0].sources[0]
    lines = []
    for look in looks:
        form = f" ({', '.join(look.sources[0].table.text)})" if look.sources[0].table.text else ""
        lines.append(f"{look.path.name}: {look.opened.family}{form}")
    if together:
        lines.append("  array      the files hold one gyro each and are about as long: one array (else: --separate)")
    lines.append(f"  time       {first.roles.time or 'none: by the rate that you gave'}")
    lines += _gyro_lines(array)
    if array.temperatures:
        lines.append(f"  thermo     {', '.join(one['name'] for one in array.temperatures)}: °C")
    if array.other:
        lines.append("  not used   " + "; ".join(f"{column} ({what})" for column, what in array.other.items()))
    if looks[0].unused:
        lines.append("  not used   tables with gyros: " + ", ".join(looks[0].unused))
    return lines


def _gyro_lines(array: ArrayDraft) -> list[str]:
    """A line for all gyros whose unit is known in the same way."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for gyro in array.gyros:
        unit = gyro.get("unit") or f"counts of {gyro['scale']:g} deg/s"
        groups.setdefault((unit, array.why[gyro["name"]].split(":")[0]), []).append(gyro)
    lines = []
    for (unit, _), gyros in groups.items():
        told = ", ".join(f"{gyro['name']} (axis {gyro['axis']}{_where(array, gyro)})" for gyro in gyros)
        lines.append(f"  gyro{'s' if len(gyros) > 1 else ' '}      {told}")
        lines.append(f"  unit       {unit}: {array.why[gyros[0]['name']]}")
    return lines


def _where(array: ArrayDraft, gyro: dict[str, Any]) -> str:
    """Where a gyro stands, if not in a column of its name."""
    place = array.places.get(gyro["name"], {"column": gyro.get("column")})
    parts = [f"{key} {place[key]}" for key in ("file", "table") if key in place]
    parts += [f"{column} {value}" for column, value in place.get("where", {}).items()]
    if gyro["name"] not in (place["column"], bare_name(place["column"])):
        parts.insert(0, f"column {place['column']}")
    return "".join(f", {part}" for part in parts)


def clock_lines(record: Integrity) -> list[str]:
    """What the stamps of each stream are; what is the same of several is said once."""
    said: dict[str, list[str]] = {}
    for clock in record.clocks:
        said.setdefault(f"{clock['meaning']}: {clock['why']}", []).append(clock["stream"])
    lines = [
        f"  clock      {text}" + (f" ({', '.join(streams)})" if len(said) > 1 else "") for text, streams in said.items()
    ]
    for clock in record.clocks:
        known = clock["alignment"]
        if known and known["by"] == "common motion":
            lines.append(
                f"  joined     {clock['stream']} begins {known['offset_s']:+.4f} s after {known['to']}"
                f" ({known['offset_low_s']:.4f} to {known['offset_high_s']:.4f}), its clock is"
                f" {known['drift_ppm']:+.1f} ppm fast ({known['drift_low_ppm']:.1f} to"
                f" {known['drift_high_ppm']:.1f}): by the motion in common"
            )
        elif known:
            lines.append(
                f"  joined     {clock['stream']} begins {known['offset_s']:+.6g} s after {known['to']}: by the stamps"
            )
    return lines


def moving_words(stretches: Sequence[tuple[float, float]]) -> str:
    """When the board moved, s: the first three stretches."""
    shown = ", ".join(f"{start:.3g} to {stop:.3g} s" for start, stop in stretches[:3])
    return shown + (f" and {len(stretches) - 3} times more" if len(stretches) > 3 else "")
