"""What the time stamps of a log are, and from them the sampling times."""

from vgyro.storage.clocks.clock import Clock
from vgyro.storage.clocks.model import ClockGap, ClockOptions, ClockRecord, Placed
from vgyro.storage.clocks.survey import survey
from vgyro.storage.clocks.unit import guess_unit

__all__ = ["Clock", "ClockGap", "ClockOptions", "ClockRecord", "Placed", "guess_unit", "survey"]
