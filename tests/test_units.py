"""Conversions against figures of the field: IEEE Std 952 conventions and the two papers' own numbers."""

import math

import numpy as np
import pytest

from vgyro import units


def test_angle_random_walk_of_the_adxrs300():
    # 0.1 deg/s/√Hz is 6 deg/√h (60 = √3600); Jiang et al. read 0.11 as about 6.17 deg/√h's 0.1028 deg/s/√Hz.
    assert units.arw_deg_rt_h(0.1) == pytest.approx(6.0)
    assert units.arw_deg_s_rt_hz(6.17) == pytest.approx(0.102833, abs=1e-6)


def test_bias_and_rate():
    assert units.deg_h(1.0) == 3600.0
    assert units.deg_s(15.04) == pytest.approx(0.00417778, abs=1e-8)


def test_rate_random_walk():
    # 1 deg/s/√s over an hour: 3600 deg/h times √3600 for √s → √h.
    assert units.rrw_deg_h_rt_h(1.0) == 216_000.0
    assert units.rrw_deg_h_rt_h(units.rrw_deg_s_rt_s(294.3)) == pytest.approx(294.3)


def test_ramp():
    assert units.ramp_deg_h2(1.0) == 12_960_000.0


def test_a_one_sided_density_is_larger_by_the_root_of_two():
    assert units.one_sided(1.0) == pytest.approx(math.sqrt(2))
    assert units.two_sided(units.one_sided(0.3)) == pytest.approx(0.3)


def test_the_earth_turns_once_in_a_sidereal_day():
    # 360° in 23.9345 h, on the vertical at the pole; nothing on the equator.
    assert units.deg_h(units.earth_rate_deg_s(90.0)) == pytest.approx(360 / 23.9345, rel=1e-3)
    assert units.earth_rate_deg_s(0.0) == 0.0
    assert units.earth_rate_deg_s(-30.0) == pytest.approx(-units.earth_rate_deg_s(90.0) / 2)


def test_radians_and_parts_per_million():
    assert units.deg_from_rad(math.pi) == pytest.approx(180.0)
    assert units.parts_per_million(150e-6) == pytest.approx(150.0)
    assert units.hours(5400.0) == 1.5


@pytest.mark.parametrize(
    "convert", [units.arw_deg_rt_h, units.deg_h, units.rrw_deg_h_rt_h, units.ramp_deg_h2, units.one_sided]
)
def test_arrays_keep_their_shape(convert):
    values = np.arange(6.0).reshape(2, 3)
    assert convert(values).shape == (2, 3)
    assert convert(values)[1, 2] == pytest.approx(convert(5.0))
