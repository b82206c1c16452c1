"""The Allan covariances of the noise record: written by `noise`, read by the tasks that fuse."""

import json

import numpy as np
from task_chain import Chain, white
from task_options import complete

from vgyro.metrics import Sampling, allan_scales
from vgyro.tasks.fusion import noise
from vgyro.tasks.fusion.noise_record import noise_of_record, read_noise
from vgyro.tasks.rates import convert

GYROS = ("g1", "g2", "g3")
INPUTS = {"frames": "frames.parquet", "integrity": "integrity.json", "calibration": "calibration.json"}


def noise_record(folder, rate):
    chain = Chain(folder, GYROS, volatility=False)
    chain.frames(rate)
    chain.run(convert, {**INPUTS, "reference": []}, ("rates",))
    chain.run(noise, {"rates": "rates.parquet"}, ("noise.json",))
    return chain


def test_written_and_read_again(tmp_path):
    rate = white(30, 3)
    chain = noise_record(tmp_path, rate)
    found = read_noise(tmp_path / "noise.json", list(GYROS)).scales
    rate_hz = 1 / found.tau[0]
    expected = allan_scales(list(rate.astype(np.float32).T), Sampling.of(rate_hz, np.zeros(len(rate), dtype=np.int32)))
    np.testing.assert_allclose(found.tau, expected.tau)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(found.pairs, expected.pairs)
    # In another order of the gyros rows and columns go with them.
    turned = noise_of_record(chain.noise(), ["g3", "g1", "g2"]).scales
    np.testing.assert_array_equal(turned.covariance[:, 0, 1], found.covariance[:, 2, 0])


def test_a_gyro_without_values_is_null(tmp_path):
    rate = white(30, 3)
    rate[:, 1] = np.nan
    chain = noise_record(tmp_path, rate)
    text = json.dumps(chain.noise(), allow_nan=False)
    assert json.loads(text)["allan_covariance"][0][1] == [None, None, None]
    found = noise_of_record(chain.noise(), list(GYROS)).scales
    assert np.isnan(found.covariance[:, 1]).all()
    assert np.isfinite(found.covariance[:, ::2, ::2]).all()


def test_none_without_rest(tmp_path):
    rate = white(30, 3)
    chain = noise_record(tmp_path, rate)
    record = {name: value for name, value in chain.noise().items() if not name.startswith("allan_")}
    assert noise_of_record(record, list(GYROS)).scales is None


def test_whose_they_are(tmp_path):
    # Of the recording that is fused, or of another one.
    record = noise_record(tmp_path, white(30, 3)).noise()
    own = [noise_of_record(record, list(GYROS), name).scales.own for name in (record["recording"], "other", "")]
    assert own == [True, False, False]


def test_the_temperature_coefficients(tmp_path):
    """Expected: the slopes of the simulation, from the record at rest; none for the fusion of that very recording."""
    rng, samples = np.random.default_rng(8), 30000
    celsius = np.linspace(20.0, 50.0, samples)
    true = np.array([0.02, 0.01, -0.01])
    rate = 0.05 * rng.standard_normal((samples, 3)) + np.outer(celsius - 25.0, true)
    chain = Chain(tmp_path, GYROS, temperature=True)
    chain.frames(rate, celsius)
    chain.run(convert, {**INPUTS, "reference": []}, ("rates",))
    chain.run(noise, {"rates": "rates.parquet"}, ("noise.json",))
    record = chain.noise()
    found = read_noise(tmp_path / "noise.json", ["g3", "g1"], "other").temperature
    np.testing.assert_allclose(found.slope, true[[2, 0]], atol=1e-3)
    assert found.scales.tau[0] == 1.0
    assert read_noise(tmp_path / "noise.json", list(GYROS), record["recording"]).temperature is None
    assert "temperature" not in noise_record(tmp_path, white(30, 3)).noise()


def test_the_engine_is_the_one_that_is_asked_for(tmp_path, monkeypatch):
    chain = noise_record(tmp_path, white(30, 3))
    asked = []
    real = noise.allan_deviation

    def watched(rate, rate_hz, taus, most, confidence, engine, *more, **named):
        asked.append(engine)
        return real(rate, rate_hz, taus, most, confidence, engine, *more, **named)

    monkeypatch.setattr(noise, "allan_deviation", watched)
    chain.run(noise, {"rates": "rates.parquet"}, ("noise.json",), analysis=complete({"engine": "reference"}))
    assert asked == ["reference"] * 3
