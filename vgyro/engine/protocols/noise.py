"""What both engines compute of Allan variances: sums of squared differences, degrees of freedom, limits."""

from __future__ import annotations

from typing import Protocol

from vgyro.arrays import Floats, Ints
from vgyro.engine.models import LossyDifferences


class AllanEngine(Protocol):
    """Allan variances, their degrees of freedom and limits, and what tells kinds of noise apart."""

    def differences(
        self, rate: Floats, factors: Ints, edges: Ints | None = None, share: int = 2, kind: str = "overlapping"
    ) -> tuple[Floats, Ints]:
        """Sum of the squared differences of means whose mean is an Allan variance, and how many there are.

        rate    : array [T], deg/s
        factors : array [M] int, ascending averaging factors m; τ = m sample periods
        edges   : array [S + 1] int, first sample of each gap-free stretch, and T; None: there is no gap
        share   : stretches of less than share·m samples are left out, and those with a single difference
        kind    : overlapping, modified or hadamard
        returns : sums [M] in (deg/s)², counts [M]; sums / counts is the variance. Zeros where no stretch is long
                  enough.
        Of the angle θ, over all k, Riley, NIST SP 1065, eq. 11, 15 and 19:
            overlapping  (θ[k+2m] - 2θ[k+m] + θ[k])² / 2τ²
            modified     ((1/m) Σ_{j=k}^{k+m-1} (θ[j+2m] - 2θ[j+m] + θ[j]))² / 2τ²
            hadamard     (θ[k+3m] - 3θ[k+2m] + 3θ[k+m] - θ[k])² / 6τ²
        """

    def slot_sums(self, rate: Floats, slot: Ints, edges: Ints) -> tuple[Floats, Ints]:
        """Sums of the samples before each border of a slot, and how many there are, where samples are lost.

        rate    : array [T], deg/s;  slot : array [T] int, place of each sample on an even time grid, rising
        edges   : array [S + 1] int, first slot of each stretch, and one past the last slot
        returns : total [P], of the samples about the mean of their stretch; have [P] int32. P = slots + S borders:
                  those of a stretch one after another, first and last included
        """

    def differences_over_losses(
        self, total: Floats, have: Ints, edges: Ints, factors: Ints, share: int = 3, kind: str = "overlapping"
    ) -> LossyDifferences:
        """The same over stretches in which samples are lost: differences of the means of the samples that are there.

        total, have, edges : of slot_sums;  factors : array [M] int, averaging factors m
        share   : stretches of less than share·m slots are left out
        kind    : overlapping, modified or hadamard
        A mean over m slots counts where nine tenths of its samples are there, and a modified difference where nine
        tenths of the differences that it averages do; nothing is put in the place of a lost sample. The samples of n
        out of m slots have, where the noise is white, a mean of variance σ₁²/n, not σ₁²/m: excess·σ₁² / counts is what
        that adds to sums / counts (for overlapping differences excess = Σ (1/n₁ + 1/n₂ - 2/m)/2), σ₁² the variance of
        a single sample. From m = 128 on, differences begin m // 64 slots apart; a modified one averages that many
        fewer.
        """

    def lag_products(
        self, rate: Floats, factors: Ints, edges: Ints | None = None, fewest: int = 4
    ) -> tuple[Floats, Floats]:
        """Σ z² and Σ z z' of the means z of adjacent blocks of m samples, z' the following mean.

        rate    : array [T];  factors : array [M] int, m; an incomplete last block is left out
        edges   : as in differences;  fewest : means, at least 4; stretches with fewer are left out
        returns : squares [M, 3], products [M, 3]: of the means about their line, of their differences about the mean
                  difference, of the second differences about theirs, each stretch by itself. Zeros without a stretch.
        """

    def degrees_of_freedom(
        self, alpha: int, factor: int, samples: Floats | Ints | int, kind: str = "overlapping"
    ) -> Floats:
        """Equivalent degrees of freedom of an Allan variance of gap-free stretches, from all overlapping differences.

        alpha   : exponent of the rate's power spectrum: 0 white, -1 flicker, -2 random walk, 1 and 2 noise of the angle
        factor  : averaging factor m;  samples : array [S] of the rates in each stretch, at least as many as one
                  difference needs: 2m, and 3m for modified and hadamard
        kind    : overlapping, modified or hadamard
        returns : array of the shape of `samples`
        Greenhall & Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003: d = 2, and
        d = 3 for hadamard; F = m, and F = 1 for modified; S = m. An exponent for which a variance does not exist
        counts as the nearest for which it does.
        """

    def limits(self, deviation: Floats, edf: Floats, confidence: float) -> tuple[Floats, Floats]:
        """Lower and upper chi² limits of deviations with `edf` degrees of freedom.  Riley, NIST SP 1065, eq. 45."""
