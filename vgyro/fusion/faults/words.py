"""Events in words."""

from __future__ import annotations

from vgyro.fusion.events import FAULT_KINDS, FaultEvent

NAMES = {"noise": "noise increase", "scale": "scale change"}
ALL_KINDS = ", ".join(NAMES.get(kind, kind) for kind in FAULT_KINDS)
MOST_EVIDENCE = 1000.0


def what(event: FaultEvent) -> str:
    """What happened, with its size."""
    match event.kind:
        case "drift":
            return f"the bias drifts by up to {event.size:+.3g} deg/s"
        case "step":
            return f"the bias jumps by {event.size:+.3g} deg/s"
        case "noise":
            return f"{event.size:.3g} times the usual noise"
        case "burst":
            return f"a burst of {event.size:.3g} times the usual noise"
        case "stuck":
            return "one value is repeated"
        case "dropout":
            return "no rate, or that of a count of zero"
        case "scale":
            return f"the scale factor changes by {100.0 * event.size:+.3g} %"


def sentence(gyro: str, event: FaultEvent, start: float, stop: float, to_the_end: bool) -> str:
    """The event in one sentence.  start, stop : s"""
    end = "to the end" if to_the_end else f"to {stop:.6g} s"
    how = ""
    if event.evidence < float("inf"):
        how = f" ({event.evidence:.3g} σ)" if event.evidence < MOST_EVIDENCE else f" (more than {MOST_EVIDENCE:g} σ)"
    return f"{gyro}: {what(event)}, from {start:.6g} s {end}{how}."
