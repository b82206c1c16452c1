"""Tables of the evidence on twins, in Markdown: python tests/fusion/twins/study.py [seeds] [part ...] > study.md

Every row of the registry on the faulty array (in motion and at rest), on the twins of Liu et al. (2015) and of Jiang et
al. (2012), and held-out halves of a real array. Ratios are geometric means over the seeds, with 95 % intervals.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import table3
import test_faulty_array
import test_jiang_twin
import test_liu_twin
import test_mimu_halves
import test_white_gyros
from harness import OURS, OURS_UNSMOOTHED, ROOT, mean_of, ratio_of

from vgyro.config import VolatilityOptions
from vgyro.fusion import METHODS


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def faulty(seeds: range) -> str:
    """In motion, then at rest."""
    parts = []
    for title, changes, still, reference in (
        ("in motion", None, False, "oracle"),
        ("the same faults at rest", test_faulty_array.AT_REST, True, "known weights"),
    ):
        found = test_faulty_array.results(seeds, changes, VolatilityOptions(), still)
        rows = []
        for name in sorted(found.sd, key=lambda name: np.mean(found.sd[name])):
            over, ours = found.over(reference, name), found.over(name)
            nees = str(mean_of(found.nees[name])) if name in found.nees else ""
            band = "full" if name in found.full else ""
            rows.append([name, f"{np.mean(found.sd[name]):.4f}", str(over), str(ours), nees, band])
        head = ["row", "error s.d., deg/s", f"over {reference}", "recommended over it", "NEES", "bandwidth"]
        parts.append(f"### Faulty array, {title}, {len(seeds)} seeds\n\n{table(head, rows)}")
    return "\n".join(parts)


def liu(seeds: range) -> str:
    """At three rates, and with standstill declared."""
    parts = []
    for rate in test_liu_twin.RATES:
        found = test_liu_twin.figures(rate, seeds, None)
        rows = []
        for name in sorted(found, key=lambda name: np.mean(found[name]["sigma"])):
            values = [f"{np.mean(found[name][figure]):.4g}" for figure in table3.LIU]
            ratios = test_liu_twin.against(found, OURS, name)
            rows.append([name, *values, *(str(ratios[figure]) for figure in table3.LIU)])
        head = ["row", "mean, deg/s", "1σ, deg/s", "ARW fitted, deg/√h", "bias drift, deg/h"]
        head += [f"recommended over it: {figure}" for figure in table3.LIU]
        parts.append(f"### Liu twin at {rate:g} deg/s, {len(seeds)} seeds\n\n{table(head, rows)}")
    rows = []
    for rate in (0.05, 10.0):
        for anchors in ("auto", "off"):
            found = test_liu_twin.figures(
                rate, seeds, [OURS, OURS_UNSMOOTHED], rest=test_liu_twin.REST, volatility=None, anchors=anchors
            )
            for name in found:
                values = [f"{np.mean(found[name][figure]):.4g}" for figure in table3.LIU]
                rows.append([f"{rate:g}", anchors, name, *values])
    head = ["rate", "anchors", "row", *table3.LIU]
    parts.append(f"### Liu twin, a minute of rest every ten minutes, {len(seeds)} seeds\n\n{table(head, rows)}")
    return "\n".join(parts)


def jiang(seeds: range) -> str:
    """At rest at equal bandwidth, and in motion."""
    static = test_jiang_twin.at_rest(seeds)
    rows = []
    for name in sorted(static, key=lambda name: np.mean(static[name]["sigma_equal"])):
        one = static[name]
        values = [f"{np.mean(one[figure]):.4g}" for figure in ("sigma_equal", "arw_1s", "bias_drift")]
        rows.append([name, *values, str(ratio_of(static[OURS]["sigma_equal"], one["sigma_equal"]))])
    head = [
        "row",
        "1σ at equal bandwidth, deg/s",
        "ARW read at 1 s, deg/√h",
        "bias drift, deg/h",
        "recommended over it: 1σ",
    ]
    parts = [f"### Jiang twin at rest, {len(seeds)} seeds\n\n{table(head, rows)}"]
    for recording in test_jiang_twin.TESTS:
        found = test_jiang_twin.dynamic(recording, seeds)
        rows = []
        for name in sorted(found, key=lambda name: np.mean(found[name]["sigma"])):
            one = found[name]
            values = [f"{np.mean(one[figure]):.5g}" for figure in table3.JIANG]
            rows.append([name, *values, str(ratio_of(found[OURS]["sigma"], one["sigma"]))])
        head = ["row", "1σ, deg/s", "delay removed", "amplitude", "delay, s", "recommended over it: 1σ"]
        parts.append(f"### Jiang twin, {recording}, {len(seeds)} seeds\n\n{table(head, rows)}")
    return "\n".join(parts)


def mimu(seeds: range) -> str:  # noqa: ARG001
    """Held-out halves of the real array."""
    folder = Path(os.environ.get("VGYRO_SHARED_DATA", ROOT / "../shared/data")).resolve()
    rows = []
    for axis in test_mimu_halves.AXES:
        found = test_mimu_halves.held_out(folder, axis, test_mimu_halves.CAPTURES)
        for name, (sample, second) in found.items():
            rows.append([axis, name, f"{sample:.4f}", f"{second:.4f}"])
    return "### MIMU array, held-out halves\n\n" + table(["axis", "weights", "s.d. of samples", "of 1 s means"], rows)


def white(seeds: range) -> str:
    """Ours over the average."""
    rows = [
        [recording, f"{seconds}", str(test_white_gyros.ratio(recording, seeds, seconds))]
        for recording in ("static", "random")
        for seconds in (60, 600, 1800)
    ]
    return "### Identical white gyros: recommended_unsmoothed over average\n\n" + table(
        ["kind", "seconds", "ratio"], rows
    )


PARTS: dict[str, Callable[[range], str]] = {
    "faulty": faulty, "liu": liu, "jiang": jiang, "mimu": mimu, "white": white
}  # fmt: skip


def main() -> None:
    """Print the parts that are asked for, or all."""
    seeds = range(1, 1 + int(sys.argv[1] if len(sys.argv) > 1 else 8))
    print(f"{len(METHODS)} methods\n")
    for name in sys.argv[2:] or PARTS:
        print(PARTS[name](seeds), flush=True)


if __name__ == "__main__":
    main()
