"""What is to be run: scenarios, seeds, methods; standard, quick or without a part of `recommended`."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import vgyro
from benchmarks.accuracy.scenario import Scenario, load, names
from vgyro.fusion.installed import fingerprint

SEEDS = 8
QUICK_REST_S, QUICK_MOTION_S = 120.0, 180.0
QUICK_SEED = 7
"""With the usual six gyros the common bias is about what their spread lets expect: a deviation shows if it is too wide,
and if it is too small."""
QUICK_METHODS = ("average", "inverse_variance_arw", "recommended_unsmoothed", "recommended")
OURS = ("recommended_unsmoothed", "recommended")


@dataclass(frozen=True)
class Task:
    """One scenario with its seeds.

    methods () : all;  variants : parts of `recommended` that are left out, one run each
    """

    scenario: Scenario
    seeds: tuple[int, ...]
    methods: tuple[str, ...] = ()
    variants: tuple[tuple[str, ...], ...] = ((),)

    @property
    def label(self) -> str:
        """Name of its file."""
        return self.scenario.name if self.variants == ((),) else f"{self.scenario.name}-parts"

    @property
    def digest(self) -> str:
        """Changes with whatever changes the results: the task itself, and the sources of vgyro and of the benchmark."""
        record = [self.scenario.model_dump(mode="json"), self.seeds, self.methods, self.variants, _sources()]
        return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()[:16]


def tasks(
    only: Sequence[str] = (),
    seeds: Sequence[int] = tuple(range(1, SEEDS + 1)),
    methods: Sequence[str] = (),
    variants: Sequence[Sequence[str]] = ((),),
    quick: bool = False,
) -> list[Task]:
    """A task a scenario.  quick : one seed, QUICK_SEED, short recordings, few methods"""
    found, left = [], tuple(tuple(one) for one in variants)
    for name in only or names():
        scenario = load(name)
        if quick:
            scenario = scenario.shorter(QUICK_REST_S, QUICK_MOTION_S)
        chosen = tuple(methods or (QUICK_METHODS if quick else ()))
        found.append(Task(scenario, (QUICK_SEED,) if quick else tuple(seeds), chosen, left))
    return found


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of all sources that the results depend on, those of packages that bring methods, too."""
    known = hashlib.sha256()
    package = Path(vgyro.__file__).parent
    files = [
        *package.rglob("*.py"),
        *package.rglob("*.pyx"),
        *package.rglob("*.[ch]"),
        *Path(__file__).parent.glob("*.py"),
    ]
    for path in sorted(files):
        known.update(path.read_bytes())
    known.update(fingerprint().encode())
    return known.hexdigest()
