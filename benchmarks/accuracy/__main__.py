"""python -m benchmarks.accuracy: every fusion method on simulated recordings with known truth."""

from __future__ import annotations

import argparse
import os
import sys

ONE_THREAD = ("VGYRO_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: list[str] | None = None) -> int:
    """Run, print, return the exit code."""
    parser = argparse.ArgumentParser("python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="NAME,…", help="scenarios")
    parser.add_argument("--methods", default="", metavar="NAME,…", help="methods; all if left out")
    parser.add_argument("--without", default="", metavar="NAME,…", help="parts of recommended that are left out")
    parser.add_argument("--seeds", type=int, default=8, metavar="N", help="seeds 1 … N")
    parser.add_argument("--first", type=int, default=1, metavar="SEED", help="the first seed")
    given = parser.parse_args(arguments)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    from benchmarks.accuracy.run import score
    from benchmarks.accuracy.scenario import names

    def split(text: str) -> list[str]:
        return [one for one in text.split(",") if one]

    for scenario in [one for text in given.only for one in split(text)] or names():
        for seed in range(given.first, given.first + given.seeds):
            for row in score(scenario, seed, split(given.methods), frozenset(split(given.without))):
                if row["state"] == "left out":
                    continue
                print(
                    f"{scenario:24s} {seed:2d} {row['part']:6s} {row['method']:24s}"
                    f" /average {row['sd'] / row['average_sd']:6.3f} 1s {row['sd_1s'] / row['average_sd_1s']:6.3f}"
                    f" NEES {row['nees']:8.3g} cover {row['coverage']:5.3f} cpu {row['cpu_s']:6.2f}"
                    f" faults {row['faults_found']}/{row['faults_true']} events {row['faults_events']}"
                    f" invented {row['faults_invented']} {row['state'] if row['state'] != 'ran' else ''}"
                    f" {row['note'][:60] if row['state'] != 'ran' else ''}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
