"""The search: take the strongest suspicion, leave that gyro out there, look again, until none is strong enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vgyro.config import FaultOptions
from vgyro.fusion.array import ArrayRates
from vgyro.fusion.events import FAULT_KINDS, FaultEvent, FaultKind
from vgyro.fusion.faults.bias import suspect_bias
from vgyro.fusion.faults.block_sums import BlockSums, block_length, block_sums, silent_share
from vgyro.fusion.faults.candidate import Candidate
from vgyro.fusion.faults.dead import find_dead
from vgyro.fusion.faults.health import healthy_array
from vgyro.fusion.faults.noise import NoiseLevel, mean_level, noise_level, ratio_of, suspect_noise
from vgyro.fusion.faults.residuals import Residuals, Spoilt, common_ratio, residuals_of, usual_variance
from vgyro.fusion.faults.scale import LEAST_CHANGE, slope_in, suspect_scale, usual_slope
from vgyro.fusion.faults.wander import Slow, local_variance, slow_part
from vgyro.fusion.faults.warmth import block_temperature, without_temperature

FEWEST_GYROS = 3
FEWEST_BLOCKS = 20
LONGEST_GAP_S = 60.0
MOST_ROUNDS = 100
WORTH = 4.0
"""Weaker evidence is not looked at a second time, against what the others do without that gyro."""
MOST_COMMON = 2.0
"""Where the gyro in the middle of the array has more than this times its usual variance, no single one is judged."""
NEAR = 8  # blocks: events of a kind that are nearer to each other are one
ONLY_DEAD = "only stuck and dropout were looked for"
TOO_FEW = f"fewer than three gyros: a difference does not tell which of two is at fault; {ONLY_DEAD}"
TOO_SHORT = f"less than {FEWEST_BLOCKS} blocks; {ONLY_DEAD}"
IN_HAND = (
    "in motion only stuck and dropout were looked for: between two rests of a free recording the board may be turned "
    "over, and its gyros are neither quite parallel nor blind to gravity"
)
LEAST_HEALTHY = 0.05
COMMON_ERRORS = 6.0
MOST_SILENT = 0.02
TOO_COARSE = f"the counts are too coarse for the noise: blocks hold one value alone; {ONLY_DEAD}"
BIAS_KINDS = ("step", "drift")
NOISE_KINDS = ("noise", "burst")


@dataclass(frozen=True)
class Search:
    """events : as of find_faults;  note : what could not be looked for in this recording, and why; "": nothing"""

    events: list[FaultEvent]
    note: str = ""


def _limits(array: ArrayRates, options: FaultOptions) -> str:
    if array.rate.shape[1] < FEWEST_GYROS:
        return TOO_FEW
    length = block_length(array.rate_hz, options.block_s)
    return TOO_SHORT if len(array.rate) < FEWEST_BLOCKS * length else ""


def find_faults(
    array: ArrayRates, options: FaultOptions | None = None, zero: np.ndarray | None = None
) -> list[FaultEvent]:
    """Stretches in which a gyro is at fault, in the order of their starts: the events of search_faults."""
    return search_faults(array, options, zero).events


def search_faults(
    array: ArrayRates, options: FaultOptions | None = None, zero: np.ndarray | None = None, in_hand: bool = False
) -> Search:
    """Look for stretches in which a gyro is at fault.

    zero : [N, 2] deg/s, between which the rate of a count of zero lies (NaN: not known), to tell dropout from stuck
    in_hand : the board may be turned over between its rests: only these are judged, and each has biases of its own
    Parity: each gyro against the inverse-variance combination of the others, so that the motion cancels. The strongest
    suspicion is taken (for a single fault that is the likelihood's choice), its gyro left out of the combination there,
    and the search begun again, so that it accuses no other. Evidence is in standard deviations of what this recording
    does in health, estimated robustly; events weaker than options.threshold are none.
    Ours (row E).
    """
    options = options or FaultOptions()
    dead = find_dead(array, zero)
    limits = _limits(array, options)
    if limits:
        return Search(dead, limits)
    gone = [[(one.start, one.stop) for one in dead if one.gyro == gyro] for gyro in range(array.rate.shape[1])]
    length = block_length(array.rate_hz, options.block_s)
    stretches = [np.array(spans, dtype=np.int64).reshape(-1, 2) for spans in gone]
    sums = block_sums(array, length, stretches, LONGEST_GAP_S)
    if np.median(silent_share(sums)) > MOST_SILENT:
        return Search(dead, TOO_COARSE)
    still, note = None, ""
    if in_hand and array.at_rest.any() and not array.at_rest.all():
        still, note = np.logical_and.reduceat(array.at_rest, sums.edges[:-1]), IN_HAND
    state = _State(
        sums, length * array.period, options, _spoilt_by(dead, sums),
        block_temperature(array.temperature, sums.edges), still,
    )  # fmt: skip
    found = [_in_samples(one, sums) for one in _merged(state.search(), options.burst_s / state.block_s)]
    return Search(sorted([*dead, *found], key=lambda event: (event.start, event.gyro, event.kind)), note)


def _spoilt_by(dead: Sequence[FaultEvent], sums: BlockSums) -> list[Spoilt]:
    found = []
    for one in dead:
        first = int(np.searchsorted(sums.edges, one.start, side="right")) - 1
        found.append(Spoilt(one.gyro, first, int(np.searchsorted(sums.edges, one.stop, side="left"))))
    return found


@dataclass
class _State:
    """What is known so far of the faults of one recording."""

    sums: BlockSums
    block_s: float
    options: FaultOptions
    dead: list[Spoilt]
    temperature: np.ndarray | None = None
    still: np.ndarray | None = None
    taken: list[Candidate] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.judged, self.run = np.ones(len(self.sums), dtype=bool), self.sums.run
        self.sigma2, self.gain = np.ones(self.sums.gyros), np.ones((len(self.sums), self.sums.gyros))

    def search(self) -> list[Candidate]:
        self.sigma2 = usual_variance(self.sums)
        self.gain = self._gain()
        self._judge()
        for _ in range(MOST_ROUNDS):
            found = self._residuals(self._spoilt())
            accepted = self._strongest(found)
            if not accepted:
                break
            self.taken += accepted
            if any(one.kind == "scale" for one in accepted):
                self.gain = self._gain()
        taken = [one for one in self.taken if one.kind != "scale" or abs(one.size) >= LEAST_CHANGE]
        return self._sized(taken, found)

    def _judge(self) -> None:
        """Leave out the blocks in motion in which most gyros leave the others at once: that is the array, not a gyro.

        Gyros that are not parallel see different parts of a hard motion, and where the board comes to rest again their
        biases may be others, as gravity has another direction. So a run ends there, too. still [B] : only these blocks
        are judged, and each stretch of them is a run.
        """
        moving = self._residuals(self.dead).moving
        # A variance of few samples is several times its mean by chance.
        most = np.maximum(MOST_COMMON, 1.0 + COMMON_ERRORS * np.sqrt(2.0 / self.sums.count))
        apart = moving & (common_ratio(self.sums, self.sigma2, np.median(self.gain, axis=0)) > most)
        self.judged = ~(apart | np.append(apart[1:], False) | np.append(False, apart[:-1]))
        hard = apart & (np.append(apart[1:], False) | np.append(False, apart[:-1]))
        begins = np.flatnonzero(np.diff(np.append(False, hard).astype(np.int8)) != 0)
        run = self.sums.run.copy()
        for place in begins:
            run[place:] += 1
        if self.still is not None:
            self.judged &= self.still
            run += np.cumsum(np.diff(self.still, prepend=self.still[:1]))
        self.run = run

    def _gain(self) -> np.ndarray:
        """Sensitivity of each gyro relative to the others [B, N]: constant but for changes that were found.

        What is known of the sizes of these changes is brought up to date. 1 without motion.
        """
        gyros, spoilt = self.sums.gyros, self._spoilt()
        gain = np.ones((len(self.sums), gyros))
        found = residuals_of(self.sums, self.sigma2, gain, spoilt, self.run)
        usual = [1.0 + usual_slope(self.sums, found, gyro, self._counts(gyro, ("scale",))) for gyro in range(gyros)]
        gain *= np.array(usual) / np.median(usual)
        if all(one.kind != "scale" for one in self.taken):
            return gain
        found = residuals_of(self.sums, self.sigma2, gain, spoilt, self.run)
        for index, one in enumerate(self.taken):
            if one.kind == "scale":
                size = slope_in(self.sums, found, one.gyro, one.first, one.last)
                self.taken[index] = replace(one, size=size)
        for one in self.taken:
            if one.kind == "scale":
                gain[one.first : one.last, one.gyro] *= 1.0 + one.size
        return gain

    def _spoilt(self) -> list[Spoilt]:
        return [*self.dead, *(Spoilt(one.gyro, one.first, one.last) for one in self.taken)]

    def _counts(self, gyro: int, kinds: Sequence[str], edges: Sequence[str] = ()) -> np.ndarray:
        """Blocks [B] without a fault of these kinds of that gyro, and without an end of one of the kinds `edges`."""
        counts = self.judged.copy()
        for dead in self.dead:
            if dead.gyro == gyro:
                counts[dead.first : dead.last] = False
        for one in self.taken:
            if one.gyro == gyro and one.kind in kinds:
                counts[one.first : one.last] = False
            if one.gyro == gyro and one.kind in edges:
                for place in (one.first, one.last):
                    counts[max(0, place - 2) : place + 2] = False
        return counts

    def _strongest(self, found: Residuals) -> list[Candidate]:
        """The strongest suspicion of all, no weaker than the threshold.

        If it is one of noise, that gyro's others come with it, wherever it has more of it than any other gyro: in one
        round, since bursts are many. Anything else could be a shadow of what was not taken yet.
        """
        levels = [self._level(found, gyro) for gyro in range(self.sums.gyros)]
        noises = [self._noises(state, gyro) for gyro, state in enumerate(levels)]
        suspects = [one for part in noises for one in part] + self._other_suspects(found)
        if not suspects:
            return []
        first = max(suspects, key=lambda one: one.evidence)
        if first.kind not in NOISE_KINDS:
            return [first]

        def loudest(one: Candidate) -> bool:
            return one.gyro == max(range(len(levels)), key=lambda gyro: mean_level(levels[gyro], one.first, one.last))

        return [one for one in noises[first.gyro] if one == first or loudest(one)]

    def _level(self, found: Residuals, gyro: int) -> NoiseLevel:
        counts = self._counts(gyro, (), (*BIAS_KINDS, "scale"))
        return noise_level(found, gyro, counts, self._counts(gyro, NOISE_KINDS))

    def _noises(self, state: NoiseLevel, gyro: int) -> list[Candidate]:
        """Suspicions of noise where none is known yet."""
        free = self._counts(gyro, NOISE_KINDS) & state.counts
        state = replace(state, level=np.where(free, state.level, 0.0), counts=free)
        return list(suspect_noise(state, gyro, self.block_s, self.options.burst_s, self.options.threshold))

    def _other_suspects(self, found: Residuals) -> list[Candidate]:
        """The strongest suspicion of every gyro, of a step or drift and of a change of scale."""
        threshold, gyros = self.options.threshold, range(self.sums.gyros)
        slow = [self._slow(found, gyro) for gyro in gyros]
        health = healthy_array(slow)
        local = [local_variance(found, gyro) for gyro in gyros]
        # What the motion is compared with is slow: noise of that sort is stronger than samples show if it has a colour.
        shares = [np.median(part.white * self.sums.count / one) for part, one in zip(slow, local, strict=True)]
        colour = max(1.0, float(np.median(shares)))
        suspects = []
        for gyro, part in enumerate(health):
            steady = self._counts(gyro, ("scale",), BIAS_KINDS)
            biases = suspect_bias(part, gyro, self.block_s, min(WORTH, threshold))
            if biases and biases[0].evidence < threshold:
                others = self._without(gyro)
                parts = [slow[one] if one == gyro else self._slow(others, one) for one in gyros]
                biases = suspect_bias(healthy_array(parts)[gyro], gyro, self.block_s, threshold)
            suspects.append(next((bias for bias in biases if self._is_event(bias)), None))
            suspects.append(suspect_scale(self.sums, found, gyro, steady, colour * local[gyro], threshold))
        return [one for one in suspects if one is not None]

    def _slow(self, found: Residuals, gyro: int) -> Slow:
        """Block means of a residual, what the temperature does to them taken off."""
        healthy = self._counts(gyro, FAULT_KINDS)
        mean = without_temperature(found.mean[:, gyro], self.temperature, healthy, self.run)
        return slow_part(found, gyro, self._counts(gyro, BIAS_KINDS), self.run, mean)

    def _without(self, gyro: int) -> Residuals:
        """Residuals in which that gyro has no part: its fault is in those of all the others, and looks like wander."""
        return self._residuals([*self._spoilt(), Spoilt(gyro, 0, len(self.sums))])

    def _residuals(self, spoilt: Sequence[Spoilt]) -> Residuals:
        """Residuals with what is known so far of usual variances, sensitivities and runs."""
        return residuals_of(self.sums, self.sigma2, self.gain, spoilt, self.run)

    def _is_event(self, one: Candidate) -> bool:
        """What would be off for all of a run has nothing left that it could be off from."""
        run = self.run == self.run[one.first]
        good = self._counts(one.gyro, BIAS_KINDS) & run
        good[one.first : one.last] = False
        return bool(good.sum() >= LEAST_HEALTHY * run.sum())

    def _sized(self, taken: Sequence[Candidate], found: Residuals) -> list[Candidate]:
        """Noise over that of the gyro's healthy stretches, now that these are known."""
        sized = []
        for one in taken:
            if one.kind in NOISE_KINDS:
                state = self._level(found, one.gyro)
                usual = state.level[state.counts & self._counts(one.gyro, NOISE_KINDS)]
                level = mean_level(state, one.first, one.last) - (float(np.median(usual)) if usual.size else 0.0)
                one = replace(one, size=ratio_of(level, state.share))
            sized.append(one)
        return sized


def _merged(found: Sequence[Candidate], burst_blocks: float) -> list[Candidate]:
    """Events of a gyro and kind that touch as one; step and drift, noise and burst are of one kind here."""
    merged: list[Candidate] = []
    for kinds in (BIAS_KINDS, NOISE_KINDS, ("scale",)):
        for one in sorted((one for one in found if one.kind in kinds), key=lambda one: (one.gyro, one.first)):
            last = merged[-1] if merged else None
            joins = last is not None and last.gyro == one.gyro and last.kind in kinds and one.first <= last.last + NEAR
            if last is None or not joins:
                merged.append(one)
                continue
            longer = max(last, one, key=lambda part: part.last - part.first)
            size = max(last.size, one.size, key=abs) if kinds is BIAS_KINDS else longer.size
            evidence = max(last.evidence, one.evidence)
            both = replace(longer, first=last.first, last=max(last.last, one.last), evidence=evidence, size=size)
            merged[-1] = both if kinds is not NOISE_KINDS else replace(both, kind=_noise_kind(both, burst_blocks))
    return merged


def _noise_kind(one: Candidate, burst_blocks: float) -> FaultKind:
    return "burst" if one.last - one.first < burst_blocks else "noise"


def _in_samples(one: Candidate, sums: BlockSums) -> FaultEvent:
    start, stop = int(sums.edges[one.first]), int(sums.edges[one.last])
    return FaultEvent(one.gyro, one.kind, start, stop, one.evidence, one.size, one.unit)
