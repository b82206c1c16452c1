"""The true rate of the table that carries the board, and the plateaus of a calibration sequence."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Floats
from vgyro.dataset import Plateau
from vgyro.simulate.twin import ConstantRate, Motion, RandomRate, RateTable, Rest, Sinusoid


class ReferenceRate:
    """True rate of a recording of so many samples, any stretch of it."""

    def __init__(self, motion: Motion, samples: int, rate_hz: float, generator: np.random.Generator) -> None:
        self._motion = motion
        self._random = (
            _band_limited(motion, samples, rate_hz, generator) if isinstance(motion, RandomRate) else np.empty(0)
        )

    def at(self, time: np.ndarray, first: int) -> np.ndarray:
        """deg/s at `time` [T], s, which is that of rows first, first + 1, … of the recording."""
        motion = self._motion
        match motion:
            case Rest():
                return np.zeros_like(time)
            case ConstantRate():
                return np.full_like(time, motion.rate)
            case Sinusoid():
                return motion.amplitude * np.sin(2.0 * np.pi * motion.frequency_hz * time + motion.phase_rad)
            case RandomRate():
                return self._random[first : first + time.size]
            case RateTable():
                return _table(motion, time)


def plateaus_of(motion: Motion) -> tuple[Plateau, ...]:
    """The even stretches of a rate table, settling left out; none for any other motion."""
    if not isinstance(motion, RateTable):
        return ()
    step = motion.settle_s + motion.plateau_s
    return tuple(
        Plateau(start=round(i * step + motion.settle_s, 9), stop=round((i + 1) * step, 9), rate=rate)
        for i, rate in enumerate(motion.rates)
    )


def _band_limited(motion: RandomRate, samples: int, rate_hz: float, generator: np.random.Generator) -> Floats:
    """Gaussian noise, flat up to the bandwidth, nothing above; the s.d. is that of the process, not of the stretch."""
    from scipy.fft import irfft, next_fast_len, rfftfreq

    length = next_fast_len(2 * samples, real=True)
    frequency = rfftfreq(length, 1.0 / rate_hz)
    inside = (frequency > 0) & (frequency <= motion.bandwidth_hz)
    spectrum = np.zeros(frequency.size, dtype=complex)
    spectrum[inside] = generator.standard_normal(inside.sum()) + 1j * generator.standard_normal(inside.sum())
    spectrum *= motion.sd * length / (2.0 * np.sqrt(max(inside.sum(), 1)))
    rate: Floats = irfft(spectrum, length)[:samples]
    return rate


def _table(motion: RateTable, time: Floats) -> Floats:
    """Half a cosine from one rate to the next during settle_s, then even; the table begins at rest."""
    step = motion.settle_s + motion.plateau_s
    rates = np.array([0.0, *motion.rates])
    index = np.minimum((time / step + 1e-9).astype(int), len(motion.rates) - 1)
    if motion.settle_s == 0:
        rate: Floats = rates[index + 1]
        return rate
    share = np.clip((time - index * step) / motion.settle_s, 0.0, 1.0)
    rate = rates[index] + (rates[index + 1] - rates[index]) * 0.5 * (1.0 - np.cos(np.pi * share))
    return rate
