"""Slow errors of the gyros, from their differences and where the board stands still, by a two-sided smoother.

The common part of the biases cannot be told from the motion by differences: the biases are about the robust centre that
their prior gives, at the start where they walk, throughout where the walks fade. Standstill pins it. See
vgyro.fusion.bias.model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.errors import DataError
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.common_walk import common_note
from vgyro.fusion.bias.followed import BiasCase, Followed
from vgyro.fusion.bias.model import Constants, Walk, root_of, with_shared_slope
from vgyro.fusion.bias.prior import empirical_prior
from vgyro.fusion.bias.smoother import run_smoother
from vgyro.fusion.blocks import SampleWeights, combined
from vgyro.fusion.types import ArrayRates, FilterParameters
from vgyro.units import rrw_deg_h_rt_h

AS_A_WHOLE = "at rest as a whole: no anchors, or its rate would be set to zero"

Weights = np.ndarray | SampleWeights


@dataclass(frozen=True)
class TemperatureCoefficients:
    """Temperature coefficients of the biases.

    slope [N], deg/s/K, covariance [N, N]: what all gyros share is known from standstill alone
    reference : temperature at which they are zero, °C
    """

    slope: np.ndarray
    covariance: np.ndarray
    reference: float


@dataclass(frozen=True)
class SlowErrors:
    """Slow errors of N gyros in B blocks of samples.

    bias       : b̂ [B, N], deg/s, with what follows the temperature;  covariance : of b̂ - b [B, N, N], (deg/s)²
    anchored   : standstill pins their common part
    temperature : coefficients; None: not regressed on
    walk       : the random walks as used;  constants : posterior of what does not walk
    note       : what to know of them
    """

    blocks: SlowBlocks
    bias: np.ndarray
    covariance: np.ndarray
    anchored: bool
    temperature: TemperatureCoefficients | None
    walk: Walk
    constants: Constants
    note: str

    def at_samples(self, values: np.ndarray) -> np.ndarray:
        """Values [B] of the blocks at the samples [T]: linear between their middles, held at the ends of a stretch."""
        result = np.empty(int(self.blocks.first[-1] + self.blocks.length[-1]))
        for samples, near in self.blocks.pieces(slice(0, len(result))):
            result[samples] = self.blocks.between(samples, near, values)
        return result


def slow_errors(
    array: ArrayRates,
    parameters: FilterParameters,
    variance: np.ndarray,
    correlation: np.ndarray | None = None,
    blocks: SlowBlocks | None = None,
    walk: Walk | None = None,
) -> SlowErrors:
    """Slow errors b_i(t) of the gyros, two-sided, so without delay, whatever the motion.

    variance    : [N] or [B, N], (deg/s)² of a sample, such that variance/n is that of the mean of n samples: of
                  coloured noise the long-run one. Where it is not finite or not above 0 the gyro is not used
    correlation : [N, N] of the noise; None: that of array.noise
    blocks      : SlowBlocks.of(array);  walk : the random walks; None: as their likelihood prefers, beginning with
                  array.noise.rrw
    returns     : SlowErrors
    raises      : DataError where the correlation is not positive definite, or the variance does not fit
    Model: vgyro.fusion.bias.model; with the noise of the walks K_i·K_j·corr_ij, that of Bayard & Ploen
    (US 2003/0187623), smoothed. Walks that fade stand for flicker. Gyros at fault are left out of their blocks.
    At rest as a whole the rate is one constant, whose size is not known: what all gyros follow the temperature is seen.
    """
    blocks = SlowBlocks.of(array) if blocks is None else blocks
    gyros = array.rate.shape[1]
    if variance.shape not in ((gyros,), (len(blocks), gyros)):
        raise DataError(
            f"variance has the shape {variance.shape}", remedy=f"give [{gyros}] or [{len(blocks)}, {gyros}]"
        )
    variance = np.broadcast_to(np.asarray(variance, dtype=float), (len(blocks), gyros))
    noise = array.noise.correlation if correlation is None else correlation
    resting, why = _anchors(array, parameters, blocks)
    if walk is None and not parameters.has("slow_walk"):
        walk = Walk(np.nan_to_num(array.noise.rrw))
    arw = usual_arw(variance, array.period)
    found = BiasCase(array, parameters, blocks, variance, noise, resting, arw, walk).followed()
    evidence, choice = found.evidence, found.choice
    constants = empirical_prior(evidence, choice.filtered).posterior(choice.filtered)
    state, covariance = run_smoother(choice.information, choice.filtered)
    constant_rate = choice.slopes and bool(array.at_rest.all())
    if constant_rate:
        so_far, _ = _with_constants(state, covariance, constants, evidence.design)
        constants = with_shared_slope(evidence, choice.walk, so_far, constants)
    bias, covariance = _with_constants(state, covariance, constants, evidence.design)
    bias, covariance = _with_common(found, blocks, bias, covariance)
    temperature = _slopes(found, constants) if choice.slopes and found.course is None else None
    notes = (
        why, found.note, _of_walk(array, choice.walk), common_note(found.common), _of_followed(found, constant_rate)
    )  # fmt: skip
    note = "; ".join(filter(None, notes))
    return SlowErrors(blocks, bias, covariance, evidence.anchored, temperature, choice.walk, constants, note)


def _with_common(
    found: Followed, blocks: SlowBlocks, bias: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """With the slopes of the record at rest, and what no difference shows: where it was nulled, and common walks."""
    if found.known is not None and found.regressor is not None:
        bias = bias + np.outer(found.regressor, found.known.slope)
        if not found.evidence.anchored:
            covariance = covariance + (found.known.nulled_sd * found.known.slope.mean()) ** 2
    if found.common and not found.evidence.anchored:
        # Seen in nothing, so that it grows from the start on, whether or not the gyros' own walks fade.
        covariance = covariance + (found.common * (blocks.time - blocks.time[0]))[:, None, None]
    return bias, covariance


def usual_arw(variance: np.ndarray, period: float) -> np.ndarray:
    """ARW [N], deg/s/√Hz, of the usual variance [B, N] of each gyro's samples."""
    usable = np.where(np.isfinite(variance) & (variance > 0), variance, np.nan)
    empty = np.isnan(usable).all(axis=0)
    usable[:, empty] = 1.0
    return np.sqrt(np.nanmedian(usable, axis=0) * period)


def _with_constants(
    state: np.ndarray, covariance: np.ndarray, constants: Constants, design: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Biases [B, N] and their covariance: b = walk of the measurement + (D - walk of the regressors)·β, design D."""
    regressors = design[..., : len(constants.mean)] - state[..., 1:]
    bias = state[..., 0] + regressors @ constants.mean
    added = (regressors @ constants.covariance) @ regressors.transpose(0, 2, 1)
    return bias, covariance + added


def _anchors(array: ArrayRates, parameters: FilterParameters, blocks: SlowBlocks) -> tuple[np.ndarray, str]:
    """Blocks in which the board stands still as a whole [B], and what is to be said of it."""
    none = np.zeros(len(blocks), dtype=bool)
    if not array.at_rest.any():
        return none, "no standstill declared: a bias that all gyros share is not seen"
    if array.at_rest.all():
        return none, AS_A_WHOLE
    if parameters.anchors == "off" or not parameters.has("anchors"):
        return none, "anchors are off: a bias that all gyros share is not seen"
    resting = blocks.all(array.at_rest)
    seconds = float(blocks.length[resting].sum()) * array.period
    if not resting.any():
        return none, "no block lies in standstill as a whole: a bias that all gyros share is not seen"
    return resting, f"pinned to zero rate by {seconds:.4g} s of standstill; the Earth's rate there is taken for bias"


def _of_walk(array: ArrayRates, walk: Walk) -> str:
    if walk.how == "given":
        unknown = np.flatnonzero(~np.isfinite(array.noise.rrw))
        which = ", ".join(str(index + 1) for index in unknown)
        return f"no random walk is known of gyro {which}: its bias is constant" if which else ""
    sizes = ", ".join(f"{rrw_deg_h_rt_h(one):.3g}" for one in walk.rrw)
    fading = f", fading in {walk.tau_s:.3g} s" if np.isfinite(walk.tau_s) else ""
    return f"K = {sizes} deg/h/√h{fading}, by likelihood (2Δ log L = {walk.gain:.1f})"


def _slopes(found: Followed, constants: Constants) -> TemperatureCoefficients:
    slopes = slice(found.evidence.plain, None)
    mean, covariance = constants.mean[slopes], constants.covariance[slopes, slopes]
    if found.known is None:
        return TemperatureCoefficients(mean, covariance, found.reference)
    root = root_of(found.known.covariance)
    return TemperatureCoefficients(found.known.slope + root @ mean, root @ covariance @ root, found.reference)


def _of_followed(found: Followed, constant_rate: bool) -> str:
    choice = found.choice
    if not np.isfinite(choice.slopes_gain):
        return ""
    if found.known is not None:
        return "the temperature coefficients are those of the record at rest, and what the differences say of them"
    compared = f"2Δ log L = {choice.slopes_gain:.1f}, {choice.needed:.1f} needed"
    if found.course is not None:
        return f"the biases {found.course.words} {found.tau_s:.3g} s ({compared})"
    if not choice.slopes:
        return f"not regressed on the temperature ({compared})"
    seen = "their common part is not"
    if found.evidence.anchored or constant_rate:
        shows = "standstill" if found.evidence.anchored else "a rate that is one constant"
        seen = f"{shows} shows their common part"
    return f"regressed on the temperature ({compared}): differences of the slopes between gyros are seen; {seen}"


def combined_without(array: ArrayRates, weights: Weights, slow: SlowErrors) -> Floats:
    """Σ u_i·(y_i - b̂_i) of the samples [T], deg/s.

    weights : [N], [T, N] or SampleWeights;  b̂ is linear between the middles of its blocks
    A piece at a time: beside the result little is made that is as long as the recording.
    """
    if isinstance(weights, np.ndarray) and weights.ndim == 1:
        combined_rate: Floats = combined(array.rate, weights) - slow.at_samples(slow.bias @ weights)
        return combined_rate
    fused, first = np.empty(len(array.rate)), 0
    for shares in weights.pieces() if isinstance(weights, SampleWeights) else [weights]:
        rows = slice(first, first + len(shares))
        for samples, near in slow.blocks.pieces(rows):
            u = shares[samples.start - first : samples.stop - first]
            fused[samples] = combined(array.rate[samples], u)
            for gyro in range(u.shape[1]):
                fused[samples] -= u[:, gyro] * slow.blocks.between(samples, near, slow.bias[:, gyro])
        first = rows.stop
    return fused


def slow_variance(weights: Weights, slow: SlowErrors) -> Floats:
    """Variance of Σ u_i·(b_i - b̂_i) in each block [B], (deg/s)²: u'Pu.

    weights : [N], [B, N] or SampleWeights, of which those of each block's middle count
    """
    if isinstance(weights, SampleWeights):
        weights = _at_middles(weights, slow.blocks)
    if weights.ndim == 1:
        return slow.covariance @ weights @ weights
    variance: Floats = np.einsum("bi,bij,bj->b", weights, slow.covariance, weights)
    return variance


def _at_middles(weights: SampleWeights, blocks: SlowBlocks) -> np.ndarray:
    """Weights [B, N] of the sample in the middle of each block."""
    middle, found, first = blocks.first + blocks.length // 2, [], 0
    for shares in weights.pieces():
        inside = slice(*np.searchsorted(middle, [first, first + len(shares)]))
        found.append(shares[middle[inside] - first])
        first += len(shares)
    return np.concatenate(found)
