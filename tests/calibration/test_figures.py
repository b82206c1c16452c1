"""Names of the figures, and what becomes of a finding."""

import math

from vgyro.calibration import FIGURES, figure_record, not_measured
from vgyro.calibration.figures import signed, unsigned


def test_names_in_the_order_of_the_certificate():
    assert list(FIGURES) == [
        "nonlinearity_full_scale", "nonlinearity_reading", "nonlinearity_rms", "asymmetry", "hysteresis",
        "repeatability", "bias_repeatability", "zero_shift", "zero_offset", "scale_temperature", "bias_temperature",
        "self_heating", "cross_axis",
    ]  # fmt: skip
    assert all(figure.title and figure.unit and figure.meaning for figure in FIGURES.values())


def test_what_is_shown_and_what_is_not():
    assert signed(300.0, 100.0, 30.0).state == "value"
    hidden = figure_record("asymmetry", signed(50.0, 100.0, 30.0))
    assert hidden == {
        "value": None, "low": -50.0, "high": 150.0, "floor": 30.0,
        "unit": "ppm", "state": "below the floor", "note": "",
    }  # fmt: skip
    assert unsigned(120.0, 60.0, 180.0, 77.0).value == 120.0
    # Not above the floor; not above 0; not larger as seen than what noise shows.
    for finding in (
        unsigned(70.0, 10.0, 90.0, 77.0),
        unsigned(120.0, 0.0, 180.0, 77.0),
        unsigned(120.0, 60.0, 180.0, 77.0, stands_out=False),
    ):
        assert (finding.state, finding.low) == ("below the floor", 0.0)
        assert math.isnan(finding.value)
    assert figure_record("cross_axis", not_measured("why"))["state"] == "not measured"
    assert figure_record("cross_axis", not_measured("why"))["value"] is None
