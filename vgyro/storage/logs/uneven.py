"""What uneven sampling does to the figures: a bound, as a sentence of the integrity record.

The later stages take sample k to be at k · T, T the mean step. With independent steps of s.d. u · T (u: uneven in the
clock's record) the mean of m samples spans m · T within u / √m of it, relatively. White noise does not depend on when
it is taken; a random walk has a variance that goes as the span, so that its Allan deviation at τ = m · T is off by at
most (u / √m)², relatively. A sinusoid of frequency f at times that are off by u · T, r.m.s., loses the share
(2π f u T)² / 2 of its amplitude to its surroundings: 0.5 % where 2π f u T is a tenth.
"""

from __future__ import annotations

import math

MOST_UNEVEN = 0.5
"""s.d. of the steps over their mean, above which a recording is suspect: no figure of single samples holds."""
SHOWN_SAMPLES = 100


def allan_bound(uneven: float, samples: float) -> float:
    """Largest relative error of the Allan deviation of a random walk, of means over so many samples; 0 for white noise.

    uneven : s.d. of the steps over their mean, independent of each other
    """
    return uneven**2 / samples


def smeared_above_hz(uneven: float, rate_hz: float) -> float:
    """Frequency, Hz, above which spectra are smeared: a sinusoid there loses 0.5 % of its amplitude."""
    return rate_hz / (2 * math.pi * uneven) / 10


def uneven_note(uneven: float, rate_hz: float, stream: str) -> str:
    """The bound, as a sentence. uneven : above 0"""
    single, many = allan_bound(uneven, 1), allan_bound(uneven, SHOWN_SAMPLES)
    tau = SHOWN_SAMPLES / rate_hz
    above = smeared_above_hz(uneven, rate_hz)
    spectra = f"spectra above about {above:.3g} Hz are smeared" if above < rate_hz / 2 else "spectra are not smeared"
    return (
        f"{stream} is sampled unevenly: steps spread by {100 * uneven:.3g} % of their mean. The Allan deviation of"
        f" white noise is not touched, that of a random walk is off by at most {100 * single:.2g} % at"
        f" {1 / rate_hz:.3g} s and {100 * many:.2g} % at {tau:.3g} s; {spectra}"
    )


def too_uneven(uneven: float, stream: str) -> str:
    """The reason why a recording is suspect."""
    return (
        f"{stream} is sampled so unevenly that its steps spread by {100 * uneven:.3g} % of their mean, more than"
        f" {100 * MOST_UNEVEN:g} %: figures below some hundred samples are doubtful"
    )
