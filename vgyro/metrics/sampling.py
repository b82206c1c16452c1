"""When the samples of a series were taken: what may be averaged together, and what may not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.runs import run_starts

MOST_LOST_S = 0.5


@dataclass(frozen=True)
class Sampling:
    """When T samples were taken, and over which losses an average may go.

    rate_hz     : slots a second of the recording's even time grid
    position    : int64 [T], slot of each sample, strictly rising
    stretch     : int32 [T], number of the stretch of each sample, never falling. Within a stretch only short losses
                  occur; nothing is ever joined across two, and the slots between two of them mean nothing
    most_lost_s : longest loss within a stretch, s
    """

    rate_hz: float
    position: np.ndarray
    stretch: np.ndarray
    most_lost_s: float = MOST_LOST_S

    @classmethod
    def of(
        cls, rate_hz: float, segment: np.ndarray, position: np.ndarray | None = None, most_lost_s: float = MOST_LOST_S
    ) -> Sampling:
        """From the gap-free segments of a recording and the slots of its samples.

        segment     : array [T] int, number of the gap-free stretch of each sample
        position    : array [T] int, round((time - start)·rate_hz); None: not known, and every segment is a stretch
        most_lost_s : losses no longer than this do not end a stretch
        raises      : ValueError if the slots do not rise within a segment
        A border between two segments without a slot lost between them is a restart of the board: the time that passed
        is not known, and the stretch ends. Slots that are lost within a segment (samples at motion, or clipped, that
        were taken out) count as a loss, too.
        """
        segment = np.asarray(segment)
        border = segment[1:] != segment[:-1]
        if position is None:
            return cls(rate_hz, np.arange(len(segment)), _numbered(border, len(segment)), most_lost_s)
        position = np.asarray(position, dtype=np.int64)
        if position.shape != segment.shape:
            raise ValueError(f"{position.size} slots for {segment.size} samples")
        steps = np.diff(position)
        restart = border & (steps < 2)
        if (steps[~restart] < 1).any():
            where = int(np.flatnonzero(~restart & (steps < 1))[0]) + 1
            raise ValueError(f"slot {position[where]} follows slot {position[where - 1]} within a segment")
        if (steps < 1).any():
            # Across a restart the slots mean nothing; they only have to rise.
            position = position[:1] + np.concatenate([[0], np.cumsum(np.where(restart, 1, steps))])
        ends = restart | (steps - 1 > _slots(most_lost_s, rate_hz))
        return cls(rate_hz, position, _numbered(ends, len(position)), most_lost_s)

    def __len__(self) -> int:
        return len(self.position)

    @property
    def segment(self) -> np.ndarray:
        """Number of the gap-free run of each sample, int32 [T]."""
        return _numbered((np.diff(self.position) != 1) | (np.diff(self.stretch) != 0), len(self))

    @property
    def missing(self) -> int:
        """Slots without a sample, within the stretches."""
        steps = np.diff(self.position)
        return int(np.sum(steps[np.diff(self.stretch) == 0] - 1))

    def slots(self) -> tuple[np.ndarray, np.ndarray]:
        """Slot of each sample, int64 [T], the stretches one after another, and the first slot of each stretch [S + 1].

        The last of the edges is one past the last slot; what lay between two stretches is left out.
        """
        first = run_starts(self.stretch)
        last = np.append(first, len(self))[1:] - 1
        edges = np.concatenate([[0], np.cumsum(self.position[last] - self.position[first] + 1)])
        return self.position + np.repeat(edges[:-1] - self.position[first], last - first + 1), edges

    def without(self, mask: np.ndarray) -> Sampling:
        """The samples that `mask` [T] does not mark; where that leaves a long loss, the stretch ends there."""
        kept = ~np.asarray(mask, dtype=bool)
        position, stretch = self.position[kept], self.stretch[kept]
        long = np.diff(position) - 1 > _slots(self.most_lost_s, self.rate_hz)
        return replace(self, position=position, stretch=_numbered(long | (np.diff(stretch) != 0), len(stretch)))


def _slots(seconds: float, rate_hz: float) -> int:
    return int(np.floor(seconds * rate_hz + 1e-6))


def _numbered(border: np.ndarray, samples: int) -> np.ndarray:
    """Number of the run of each sample, int32 [T]; border [T - 1]: does a run begin with the next sample?"""
    return np.cumsum(np.concatenate([np.zeros(min(samples, 1), bool), border]), dtype=np.int32)
