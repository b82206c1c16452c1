"""Events in words."""

from __future__ import annotations

from vgyro.fusion.events import FAULT_KINDS, FaultEvent

NAMES = {"noise": "noise increase", "scale": "scale change", "dead": "no motion in it", "clipped": "range too small"}
ALL_KINDS = ", ".join(NAMES.get(kind, kind) for kind in FAULT_KINDS)
MOST_EVIDENCE = 1000.0


def what(event: FaultEvent, other: str = "another gyro") -> str:
    """What happened, with its size.  other : name of the gyro that a copy repeats"""
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
        case "dead":
            return "the motion of the others is not in its rate"
        case "copy":
            return f"it repeats {other} sample by sample"
        case "outlier":
            return f"an absurd value, off by {event.size:+.3g} deg/s"
        case "clipped":
            return f"it clips at {event.size:.3g} deg/s, where the others go on"


def sentence(gyro: str, event: FaultEvent, start: float, stop: float, to_the_end: bool, other: str = "") -> str:
    """The event in one sentence.  start, stop : s;  other : name of the gyro that a copy repeats"""
    end = "to the end" if to_the_end else f"to {stop:.6g} s"
    how = ""
    if event.evidence < float("inf"):
        how = f" ({event.evidence:.3g} σ)" if event.evidence < MOST_EVIDENCE else f" (more than {MOST_EVIDENCE:g} σ)"
    when = f"at {start:.6g} s" if event.kind == "outlier" else f"from {start:.6g} s {end}"
    return f"{gyro}: {what(event, other or 'another gyro')}, {when}{how}."
