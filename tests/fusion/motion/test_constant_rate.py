"""What a constant rate does to a method: nothing, where it says so; to the weights of the level, a lot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vgyro.fusion import METHODS, FilterParameters, run_methods, select
from vgyro.simulate import parse_twin, simulate_recording
from vgyro.storage.inputs import read_board
from vgyro.volatility.fits import fit_windows, window_models
from vgyro.volatility.rolling import weights_of_windows
from vgyro.volatility.stretches import Window, rolling_windows

RATE = 0.05
DEFINITIONS = ("level", "demeaned", "difference", "residual")
LIU = Path("config/twins/liu2015.yaml")


def liu(root, **changes):
    """Second means [3600, 6] of the twin's static recording, deg/s; changes : text of the twin → other text."""
    text = (root / LIU).read_text(encoding="utf-8")
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    rates = simulate_recording(
        parse_twin(text, "twin"), read_board("dsp6", boards=root / "config/boards"), "static"
    ).rates
    return rates.reshape(-1, 200, 6).mean(axis=1)


def weights(values, definition):
    """(model, mode) → weights [M, 6], as the workflow makes them."""
    windows = rolling_windows([Window(0, len(values))], 360, 30)
    fits = fit_windows(values, windows.start, 360, definition, 15, windows.stretch_start, "native")
    models = window_models(fits, windows.start, 360, [f"g{number}" for number in range(1, 7)])
    modes = ("in_sample", "causal")
    return {
        (model, mode): found.weights
        for model in ("dcc", "ccc")
        for mode, found in weights_of_windows(values, models, windows.runs, definition, modes, model, 30).items()
    }


def test_methods_that_say_so_do_not_see_a_constant_rate(make_array):
    still = make_array(6000, [0.05, 0.1, 0.1, 0.3])
    moving = make_array(6000, [0.05, 0.1, 0.1, 0.3], truth=RATE)
    chosen = [
        name for name, method in METHODS.items() if "" in method.same_at_any_rate and "weights" not in method.needs
    ]
    rates = [
        {outcome.column: outcome.fused.rate for outcome in run_methods(array, FilterParameters(), select(chosen), ())}
        for array in (still, moving)
    ]
    for name in chosen:
        np.testing.assert_allclose(rates[1][name] - RATE, rates[0][name], atol=1e-12, err_msg=name)


def test_only_methods_that_do_not_say_so_are_run_again(make_array):
    array = make_array(6000, [0.05, 0.1, 0.1, 0.3])
    again = run_methods(array, FilterParameters(), select("all"), DEFINITIONS, moved=True)
    names = [(outcome.method.name, outcome.definition) for outcome in again]
    assert names == [
        *((name, "") for name in ("rolling_moment", "ewma_causal", "ewma_two_sided")),
        *((name, "") for name in ("chang_2008", "stubberud_2008", "jiang_markov")),
        *((name, "level") for name in ("ccc_in_sample", "ccc_causal", "dcc_in_sample", "dcc_causal")),
    ]


@pytest.fixture(scope="module")
def levels(root):
    return liu(root)


@pytest.mark.parametrize("definition", DEFINITIONS[1:])
def test_weights_without_the_level_are_the_same_at_any_rate(levels, definition):
    # r_t is the same but for rounding, and so is every optimum of its likelihood, as far as it is found: 1e-4.
    still, moving = (weights(values, definition) for values in (levels, levels + RATE))
    for key, found in moving.items():
        np.testing.assert_allclose(found, still[key], atol=1e-4, err_msg=str(key))


def test_weights_of_the_level_shrink_the_rate(levels):
    # Found before, independently: a constant true rate of 0.05 deg/s gives DCC of the level a mean error of -0.026.
    # The average's, 0.024, is that of its bias. At rest DCC looks perfect: below the smallest mean of a single gyro.
    still, moving = (weights(values, "level") for values in (levels, levels + RATE))
    key = "dcc", "in_sample"
    at_rest = (still[key] * levels).sum(axis=1).mean()
    error = (moving[key] * (levels + RATE)).sum(axis=1).mean() - RATE
    assert error == pytest.approx(-0.026, abs=0.003)
    assert 0 < at_rest < 0.0066 < levels.mean()
    for key, found in moving.items():
        shrunk = (found * (levels + RATE)).sum(axis=1).mean() - RATE - (still[key] * levels).sum(axis=1).mean()
        assert -0.035 < shrunk < -0.015, key


def test_an_added_rate_is_a_simulated_one(root, levels):
    # The twin turned at 0.05 deg/s, with scale factors that are right: the same noise, the rate inside the simulation.
    changes = {f"g{number}": (f"scale_error: {error}", "scale_error: 0") for number, error in SCALES.items()}
    turned = liu(root, motion=STILL_AND_TURNED, **changes)
    np.testing.assert_allclose(turned, levels + RATE, atol=1e-9)
    added, simulated = (weights(values, "level") for values in (levels + RATE, turned))
    for key, found in added.items():
        np.testing.assert_allclose(found, simulated[key], atol=1e-4, err_msg=str(key))


SCALES = {1: "0.037", 2: "-0.021", 3: "-0.044", 4: "0.012", 5: "0.058", 6: "-0.030"}
STILL_AND_TURNED = (
    "  - name: static\n    kind: static\n",
    "  - name: static\n    kind: constant\n    motion: {kind: constant, rate: 0.05}\n",
)
