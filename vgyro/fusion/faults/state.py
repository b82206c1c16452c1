"""What is known so far of the faults of one recording, while the search goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vgyro.arrays import Bools
from vgyro.config import FaultOptions
from vgyro.fusion.events import FAULT_KINDS
from vgyro.fusion.faults.block_sums import BlockSums
from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.levels.alike import of_the_array
from vgyro.fusion.faults.levels.bias import suspect_bias
from vgyro.fusion.faults.levels.drift_variance import Slow, local_variance, slow_part
from vgyro.fusion.faults.levels.health import healthy_array
from vgyro.fusion.faults.levels.lag import without_lag
from vgyro.fusion.faults.levels.temperature import without_temperature
from vgyro.fusion.faults.noise import NoiseLevel, mean_level, noise_level, ratio_of, suspect_noise
from vgyro.fusion.faults.residuals import Residuals, Spoilt, common_ratio, residuals_of, spans_of, usual_variance
from vgyro.fusion.faults.rounding import rounding_of
from vgyro.fusion.faults.scale import FEWEST_BLOCKS, LEAST_CHANGE, relative_gain, slope_in, suspect_scale

MOST_ROUNDS = 100
GAIN_ROUNDS = 2
WORTH = 4.0
"""Weaker evidence is not looked at a second time, against what the others do without that gyro."""
MOST_COMMON = 2.0
"""Where the gyro in the middle of the array has more than this times its usual variance, no single one is judged."""
FEWEST_PARTNERS = 2
"""With one other gyro a difference does not tell which of the two is at fault."""
LEAST_HEALTHY = 0.05
"""Share of the blocks that are right: a fault of all of them is none, there is nothing that it could be off from."""
COMMON_ERRORS = 6.0
DEAF = 0.1
"""A gyro with less than this share of the others' motion in its rate shows nothing of it."""
BIAS_KINDS = ("step", "drift")
NOISE_KINDS = ("noise", "burst")


@dataclass
class State:
    """What is known so far of the faults of one recording of N gyros in B blocks; the search adds to it.

    sums        : the block means and their second moments;  block_s : length of a block, s
    options     : the user's thresholds
    temperature : [B], °C; None: not known
    still       : [B] of bool, only these blocks are judged, and biases may change between stretches of them; None: all
                  are
    step        : [N], deg/s, distance of neighbouring values of each gyro, 0 where no steps are seen; None: nowhere
    taken       : the faults that were found
    silenced    : gyros that stop to show the motion, from then on
    Made from these: `deaf`, gyros that show nothing of the motion in the whole recording; `sigma2` [N], (deg/s)², the
    usual variance of a sample; `gain` [B, N], how much of the motion a gyro shows; `judged` [B]; `run` [B]; `rounding`.
    """

    sums: BlockSums
    block_s: float
    options: FaultOptions
    temperature: np.ndarray | None = None
    still: np.ndarray | None = None
    step: np.ndarray | None = None
    taken: list[SuspectedFault] = field(default_factory=list)
    silenced: list[SuspectedFault] = field(default_factory=list)

    def __post_init__(self) -> None:
        gyros = self.sums.gyros
        self.dead = spans_of(~self.sums.alive)
        self.judged, self.run = self.sums.alive.sum(axis=1) > FEWEST_PARTNERS, self.sums.run
        self.sigma2, self.gain = np.ones(gyros), np.ones((len(self.sums), gyros))
        for _ in range(GAIN_ROUNDS):
            self.sigma2 = usual_variance(self.sums, np.median(self.gain, axis=0))
            self.gain = self._gain()
            self.deaf = self._deaf()
            if self.deaf:
                break
        step = np.zeros(gyros) if self.step is None else self.step
        self.rounding = rounding_of(step, self.sigma2)

    def search(self) -> list[SuspectedFault]:
        """Faults in blocks, in the order in which they were found."""
        self._judge()
        for _ in range(MOST_ROUNDS):
            found = self._residuals(self._spoilt())
            accepted = self._strongest(found)
            if not accepted:
                break
            if accepted[0].kind == "scale" and accepted[0].size < DEAF - 1.0:
                self._silence(accepted[0])
                continue
            self.taken += accepted
            if any(one.kind == "scale" for one in accepted):
                self.gain = self._gain()
        taken = [one for one in self.taken if one.kind != "scale" or abs(one.size) >= LEAST_CHANGE]
        return [one for one in self._sized(taken, found) if self._is_event(one, BIAS_KINDS + NOISE_KINDS + ("scale",))]

    def _deaf(self) -> list[SuspectedFault]:
        """Gyros without the motion in their rates, and with no more noise than is left without it.

        A gain as small, with more noise, is none: the others share something that is no motion, as noise from one
        supply. It is taken to be one.
        """
        found = residuals_of(self.sums, self.sigma2, np.ones(self.gain.shape), self.dead, self.run)
        gain, heard = np.median(self.gain, axis=0), []
        for gyro in np.flatnonzero(gain < DEAF).tolist():
            rows = found.moving & self.sums.alive[:, gyro]
            energy, own = found.energy[rows, gyro].sum(), self.sums.variance(gyro)[rows].sum()
            if own < DEAF * energy:
                times = self.sums.count[rows] * found.energy[rows, gyro] / self.sigma2[gyro]
                heard.append(
                    SuspectedFault(
                        gyro, "dead", 0, len(rows), float(np.sqrt(times.sum())), float(gain[gyro]) - 1.0, "1"
                    )
                )
            else:
                self.gain[:, gyro] = 1.0
        return heard

    def _silence(self, one: SuspectedFault) -> None:
        """A gyro that stops to show the motion is no gyro from then on."""
        self.sums.alive[one.first : one.last, one.gyro] = False
        self.dead = spans_of(~self.sums.alive)
        self.judged &= self.sums.alive.sum(axis=1) > FEWEST_PARTNERS
        self.silenced.append(replace(one, kind="dead"))
        self.gain = self._gain()

    def _judge(self) -> None:
        """Leave out the blocks in motion in which most gyros leave the others at once: that is the array, not a gyro.

        Gyros that are not parallel see different parts of a hard motion, and where the board comes to rest again their
        biases may be others, as gravity has another direction. So a run ends there, too. Of a motion that is too short
        to tell the scale factors nothing is judged.
        """
        moving = self._residuals(self.dead).moving
        # A variance of few samples is several times its mean by chance.
        most = np.maximum(MOST_COMMON, 1.0 + COMMON_ERRORS * np.sqrt(2.0 / self.sums.count))
        apart = moving & (common_ratio(self.sums, self.sigma2, np.median(self.gain, axis=0)) > most)
        if moving.sum() < FEWEST_BLOCKS:
            apart |= moving
        self.judged &= ~(apart | np.append(apart[1:], False) | np.append(False, apart[:-1]))
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
        counts = [self._counts(gyro, ("scale",)) for gyro in range(gyros)]
        gain = np.tile(relative_gain(self.sums, self.sigma2, spoilt, self.run, counts), (len(self.sums), 1))
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

    def _counts(self, gyro: int, kinds: Sequence[str], edges: Sequence[str] = ()) -> Bools:
        """Blocks [B] without a fault of these kinds of that gyro, and without an end of one of the kinds `edges`.

        Only where at least two others are right.
        """
        right = self.sums.alive.copy()
        for one in self.taken:
            if one.gyro != gyro:
                right[one.first : one.last, one.gyro] = False
        counts: Bools = self.judged & right[:, gyro] & (right.sum(axis=1) > FEWEST_PARTNERS)
        for one in self.taken:
            if one.gyro == gyro and one.kind in kinds:
                counts[one.first : one.last] = False
            if one.gyro == gyro and one.kind in edges:
                for place in (one.first, one.last):
                    counts[max(0, place - 2) : place + 2] = False
        return counts

    def _strongest(self, found: Residuals) -> list[SuspectedFault]:
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

        def loudest(one: SuspectedFault) -> bool:
            return one.gyro == max(range(len(levels)), key=lambda gyro: mean_level(levels[gyro], one.first, one.last))

        return [one for one in noises[first.gyro] if one == first or loudest(one)]

    def _level(self, found: Residuals, gyro: int) -> NoiseLevel:
        counts = self._counts(gyro, (), (*BIAS_KINDS, "scale"))
        return noise_level(found, gyro, counts, self._counts(gyro, NOISE_KINDS))

    def _noises(self, state: NoiseLevel, gyro: int) -> list[SuspectedFault]:
        """Suspicions of noise where none is known yet."""
        free = self._counts(gyro, NOISE_KINDS) & state.counts
        state = replace(state, level=np.where(free, state.level, 0.0), counts=free)
        return list(suspect_noise(state, gyro, self.block_s, self.options.burst_s, self.options.threshold))

    def _other_suspects(self, found: Residuals) -> list[SuspectedFault]:
        """The strongest suspicion of every gyro, of a step or drift and of a change of scale."""
        threshold, gyros = self.options.threshold, range(self.sums.gyros)
        slow = [self._slow(found, gyro) for gyro in gyros]
        health = self._health(slow)
        local = [local_variance(found, gyro) for gyro in gyros]
        # What the motion is compared with is slow: noise of that sort is stronger than samples show if it has a colour.
        shares = [np.median(part.white * self.sums.count / one) for part, one in zip(slow, local, strict=True)]
        colour = max(1.0, float(np.median(shares)))
        suspects = []
        for gyro, part in enumerate(health):
            suspects += self._bias_suspects(gyro, part, slow)
            steady = self._counts(gyro, ("scale",), (*BIAS_KINDS, "scale"))
            scale = suspect_scale(self.sums, found, gyro, steady, colour * local[gyro], threshold)
            suspects += [scale] if scale is not None and self._is_event(scale, ("scale",)) else []
        return suspects

    def _bias_suspects(self, gyro: int, part: Slow, slow: Sequence[Slow]) -> list[SuspectedFault]:
        """The strongest suspicion of a step or drift of a gyro; none where the others do the like."""
        threshold = self.options.threshold
        biases = suspect_bias(part, gyro, self.block_s, min(WORTH, threshold))
        if not biases:
            return []
        others = self._residuals([*self._spoilt(), Spoilt(gyro, 0, len(self.sums))])
        # Its fault is in the residuals of all the others, and looks like wander, where it has a part in them.
        apart = [part if one == gyro else self._slow(others, one) for one, part in enumerate(slow)]
        if biases[0].evidence < threshold:
            biases = suspect_bias(self._health(apart)[gyro], gyro, self.block_s, threshold)
        events = (one for one in biases if self._is_event(one, BIAS_KINDS) and not of_the_array(one, apart))
        return list(events)[:1]

    def _health(self, slow: Sequence[Slow]) -> list[Slow]:
        """With what biases do in health. A rounding error that stays while the rate does is of that sort, too."""
        return [replace(part, flicker=part.flicker + 2.0 * lasting)
                for part, lasting in zip(healthy_array(slow), self.rounding.lasting, strict=True)]  # fmt: skip

    def _slow(self, found: Residuals, gyro: int) -> Slow:
        """Block means of a residual, what the temperature and a delay do to them taken off."""
        healthy = self._counts(gyro, FAULT_KINDS)
        mean = without_temperature(found.mean[:, gyro], self.temperature, healthy, self.run)
        mean = without_lag(mean, found.motion[:, gyro], healthy & found.moving, self.run)
        return slow_part(found, gyro, self._counts(gyro, BIAS_KINDS, ("scale",)), self.run, mean)

    def _residuals(self, spoilt: Sequence[Spoilt]) -> Residuals:
        """Residuals with what is known so far of usual variances, sensitivities and runs.

        Where steps are coarse the variance is what it may be at most: no noise comes and goes there.
        """
        found = residuals_of(self.sums, self.sigma2, self.gain, spoilt, self.run)
        toggles = self.rounding.toggles
        if not toggles.any():
            return found
        share = np.where(np.eye(self.sums.gyros, dtype=bool), 0.0, 1.0 / self.sigma2)
        share /= share.sum(axis=1, keepdims=True)
        most = found.expected + toggles + share**2 @ toggles
        return replace(found, variance=np.fmax(found.variance, most))

    def _is_event(self, one: SuspectedFault, kinds: Sequence[str]) -> bool:
        """What is off for all of a run, or a scale or noise for all of the recording, has nothing that it is off from.

        kinds : faults of these kinds of that gyro are not right either
        """
        rows = self.run == self.run[one.first] if one.kind in BIAS_KINDS else np.ones(len(self.sums), dtype=bool)
        good = self._counts(one.gyro, kinds) & rows
        good[one.first : one.last] = False
        return bool(good.sum() >= LEAST_HEALTHY * rows.sum())

    def _sized(self, taken: Sequence[SuspectedFault], found: Residuals) -> list[SuspectedFault]:
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
