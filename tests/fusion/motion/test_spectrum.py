"""What the choice of a motion rests on: densities, spectra of pieces, the estimated risk, lines, and what it costs."""

import math
import time

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.fusion.motion import choice, density, evidence
from vgyro.fusion.motion.choice import beside_fixed, choose_motion
from vgyro.fusion.motion.evidence import gather, spectrum
from vgyro.fusion.motion.lines import peak, sinusoid
from vgyro.fusion.motion.models import NARROW, Motion, SteadyGain, fixed_bandwidth
from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.search import FAMILIES, search
from vgyro.fusion.motion.shared import shared_lines
from vgyro.fusion.motion.smoother import smooth

RATE_HZ, R = 50.0, 0.0064
VALUES = {
    "random_walk": {"q": 3.0},
    "acceleration": {"q": 40.0},
    "jerk": {"q": 500.0},
    "markov": {"tau_s": 0.8, "sd": 2.0},
    "resonance": {"frequency_hz": 0.5, "damping": 0.1, "sd": 2.0},
    "oscillator": {"frequency_hz": 0.5, "damping": 0.1, "sd": 2.0, "q": 0.01},
    "pair": {"frequency_hz": 0.4, "damping": 0.3, "second_hz": 0.9, "second_damping": 0.06, "sd": 2.0},
}


def one_stretch(z):
    return np.zeros(len(z), dtype=np.int32)


def poles(seed, samples, sd=20.0, pole_hz=0.15, rate_hz=RATE_HZ):
    """Three first-order poles in a row, driven by white noise."""
    keep = math.exp(-2 * math.pi * pole_hz / rate_hz)
    rate = np.random.default_rng(seed).standard_normal(samples + int(40 / pole_hz))
    for _ in range(3):
        rate = lfilter([1 - keep], [1, -keep], rate)
    rate = rate[-samples:]
    return rate * sd / rate.std()


def white(seed, samples):
    return math.sqrt(R) * np.random.default_rng(1000 + seed).standard_normal(samples)


@pytest.mark.parametrize("family", VALUES)
def test_densities_are_those_of_the_discrete_models(family):
    # Expected: S = G·S_v/(1 - G) of the gain that follows from F and Q (SteadyGain), up to a quarter of the rate.
    kind, r, rate_hz = FAMILIES[family], 0.09, 20.0
    values = VALUES[family] | ({"q": 0.0} if family == "resonance" else {})
    frequency = np.geomspace(0.01, 0.25 * rate_hz, 200)
    gain = SteadyGain(Motion(kind.model, values, rate_hz), r).at(frequency)
    found = kind.density({name: np.array([[VALUES[family][name]]]) for name in kind.names}, frequency, rate_hz)[0]
    np.testing.assert_allclose(found, gain / (1.0 - gain) * r / rate_hz, rtol=0.02)


def test_power_of_two_sections():
    # Expected: the integral of their product over all frequencies, by quadrature.
    own, damping, second, loss = (np.array(one) for one in (0.4, 0.3, 0.9, 0.06))
    frequency = np.linspace(-60, 60, 2_000_001)
    product = density._section(own, damping, frequency) * density._section(second, loss, frequency)
    assert density.pair_power(own, damping, second, loss) == pytest.approx(np.trapezoid(product, frequency), rel=1e-5)


@pytest.mark.parametrize("phi", [0.0, 0.6])
def test_noise_of_pieces_with_holes(phi):
    # Expected: the mean periodogram of 200 simulated noises, in eight octaves, within 4 standard errors and 3 %; one
    # sample in ten is missing and filled in, one in four has three times the variance.
    samples, rng = 2000, np.random.default_rng(1)
    r = np.where(rng.random(samples) < 0.25, 3.0, 1.0)
    r[rng.random(samples) < 0.1] = np.inf
    deviation = np.sqrt(np.where(np.isfinite(r), r, 0.0))
    total = 0.0
    for seed in range(200):
        noise = np.random.default_rng(seed).standard_normal(samples + 100)
        noise = lfilter([math.sqrt(1 - phi**2)], [1, -phi], noise)[100:] if phi else noise[100:]
        found = spectrum(gather(NoisyRate(deviation * noise, r, one_stretch(r), RATE_HZ, phi)), RATE_HZ)
        total = total + found.power / 200
    octave = np.floor(np.log2(found.frequency)).astype(int)
    for one in np.unique(octave):
        inside = octave == one
        error = math.sqrt(2.0 / (200 * found.weight[inside].sum()))
        # A colour is that of a series without holes.
        assert total[inside].mean() / found.noise[inside].mean() == pytest.approx(
            1, abs=4 * error + (0.25 if phi else 0.03)
        )


def test_noise_between_known_samples_dense():
    # Expected: white noise known at some samples, the others by np.interp, its Fourier sums from the dense matrix.
    places, power = np.array([0, 1, 4, 6, 7, 11]), np.array([1.0, 2.0, 0.5, 3.0, 1.0, 4.0])
    fill = np.column_stack([np.interp(np.arange(12), places, one) for one in np.eye(len(places))])
    turn = np.exp(-2j * np.pi * np.arange(1, 6) / 12.0)
    sums = turn[:, None] ** np.arange(12) @ fill
    np.testing.assert_allclose(evidence._of_filled(places, power, turn), np.abs(sums) ** 2 @ power, rtol=1e-9)


def test_estimated_risk_is_that_of_the_smoother():
    # Known truth: motion of three poles, 24 seeds; two models that are wrong, with q from too little to too much. The
    # mean of the estimates is the mean of the true squared errors, within three standard errors of that.
    samples = 15_000
    for model, order, width in (("jerk", 3, 1.0), ("jerk", 3, 3.0), ("random_walk", 1, 12.0), ("acceleration", 2, 3.0)):
        q = R / RATE_HZ * (2 * math.pi * width) ** (2 * order)
        motion, estimated, true = Motion(model, {"q": q}, RATE_HZ), [], []
        for seed in range(24):
            truth = poles(seed, samples)
            z = truth + white(seed, samples)
            found = spectrum(gather(NoisyRate(z, R, one_stretch(z), RATE_HZ)), RATE_HZ)
            signal = FAMILIES[model].density({"q": np.array(q)}, found.frequency, RATE_HZ)
            estimated.append(float(found.risk(signal)) / found.weight.sum())
            error = smooth(NoisyRate(z, R, one_stretch(z), RATE_HZ), motion).rate - truth
            true.append(np.mean(error[500:-500] ** 2) / R)
        apart = np.array(estimated) - np.array(true)
        assert abs(apart.mean()) < 3.0 * apart.std(ddof=1) / math.sqrt(len(apart))


def test_no_leakage_from_eight_decades():
    # Truth: three poles of 0.02 Hz, 2000 deg/s, twelve decades above the noise, are 1 % of it above 5 Hz, and nothing
    # leaks there.
    z = poles(3, 30_000, 2000.0, 0.02) + white(3, 30_000)
    found = spectrum(gather(NoisyRate(z, R, one_stretch(z), RATE_HZ)), RATE_HZ).between(5.0, 20.0)
    assert np.mean(found.power / found.noise) == pytest.approx(1.0, abs=0.05)


def test_pieces():
    # Expected: by definition. Short holes are filled in, long ones and gaps end a piece; ends say something.
    r, segment = np.ones(1000), np.zeros(1000, dtype=int)
    segment[600:] = 1
    r[:5], r[100:110], r[300:330], r[990:] = np.inf, np.inf, np.inf, np.inf
    z = np.random.default_rng(1).standard_normal(1000)
    z[np.isinf(r)] = np.nan
    found = gather(NoisyRate(z, r, segment, RATE_HZ))
    assert [(one.start, len(one.z)) for one in found] == [(5, 295), (330, 270), (600, 390)]
    moving = np.ones(1000, dtype=bool)
    moving[700:800] = False
    found = gather(NoisyRate(z, r, segment, RATE_HZ), moving)
    assert [(one.start, len(one.z)) for one in found] == [(5, 295), (330, 270), (600, 100), (800, 190)]
    assert all(np.isfinite(one.z).all() for one in found)


def test_many_pieces_are_thinned_out(monkeypatch):
    monkeypatch.setattr(evidence, "LONGEST", 100)
    monkeypatch.setattr(evidence, "MOST_SAMPLES", 500)
    z = np.random.default_rng(1).standard_normal(2000)
    found = gather(NoisyRate(z, 1.0, one_stretch(z), RATE_HZ))
    assert [one.start for one in found] == [0, 400, 900, 1400, 1900]


@pytest.mark.parametrize("sort", ["t3", "outliers", "white"])
def test_samples_far_off_are_no_motion(sort):
    # Known truth: noise of Student's t with three degrees of freedom, or 2 % of the samples ten times as large. The
    # error is at most 3 % above that with the model that white noise of the same variance gives.
    ratios = []
    for seed in range(4):
        rng, truth = np.random.default_rng(seed), poles(seed, 20_000)
        noise = rng.standard_t(3, 20_000) / math.sqrt(3) if sort == "t3" else rng.standard_normal(20_000)
        if sort == "outliers":
            noise[rng.random(20_000) < 0.02] *= 10.0
            noise /= math.sqrt(0.98 + 0.02 * 100.0)
        z, known = truth + math.sqrt(R) * noise, truth + white(seed, 20_000)
        runs = [
            smooth(
                NoisyRate(z, R, one_stretch(z), RATE_HZ), choose_motion(NoisyRate(one, R, one_stretch(z), RATE_HZ))
            ).rate
            for one in (z, known)
        ]
        ratios.append(np.std(runs[0] - truth) / np.std(runs[1] - truth))
    assert np.mean(ratios) < 1.03


def test_vibrations_are_motion():
    """Known truth: 2 deg/s r.m.s. at 5 Hz, half of it at 10 Hz and a little at 17.3 Hz beside motion of three poles, 5
    minutes: the error is within 2 % of that without the vibrations, and the s.d. is honest."""
    time, errors, nees = np.arange(15_000) / RATE_HZ, [], []
    waves = sum(size * np.sin(2 * math.pi * own * time) for size, own in ((2.8, 5.0), (1.4, 10.0), (0.3, 17.3)))
    for seed in range(3):
        truth = poles(seed, len(time))
        for other in (waves, 0.0):
            z = truth + other + white(seed, len(time))
            motion = choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ))
            found = smooth(NoisyRate(z, R, one_stretch(z), RATE_HZ), motion)
            errors.append(np.std((found.rate - truth - other)[500:-500]))
            nees.append(np.mean((found.rate - truth - other)[500:-500] ** 2 / found.variance[500:-500]))
            assert len(motion.lines) == (3 if other is waves else 0)
        assert errors[-2] < 1.02 * errors[-1]
    assert np.mean(nees) == pytest.approx(1.0, abs=0.15)


def test_a_broad_vibration_has_a_width():
    # Known truth: 0.1 deg/s about 8 Hz, damping 0.02, which no sinusoid is.
    samples, own, damping = 15_000, 8.0, 0.02
    turn = math.exp(-2 * math.pi * own * damping / RATE_HZ)
    wave = lfilter([1], [1, -2 * turn * math.cos(2 * math.pi * own / RATE_HZ), turn**2], white(9, samples))
    z = poles(1, samples) + 0.1 * wave / wave.std() + white(1, samples)
    line = max(choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ)).lines, key=lambda one: one.sd)
    assert line.frequency_hz == pytest.approx(own, rel=0.01)
    assert line.damping == pytest.approx(damping, rel=0.4)
    assert line.sd == pytest.approx(0.1, rel=0.2)


def test_no_lines_in_noise():
    # Truth: none. The price of a line is such that the highest of all lines of white noise is hardly ever taken.
    for seed in range(12):
        motion = choose_motion(NoisyRate(white(seed, 20_000), R, one_stretch(np.empty(20_000)), RATE_HZ))
        assert motion.lines == ()
        assert motion.model != "oscillator"


def test_frequency_of_a_sinusoid():
    # Known truth; error of the frequency √6·σ/(π·A·T·√samples) (Rife & Boorstyn 1974) times 1.5 for the taper.
    samples, size = 9000, 0.5
    time = np.arange(samples) / RATE_HZ
    limit = 4 * 1.5 * math.sqrt(6 * R) / (math.pi * size * samples / RATE_HZ * math.sqrt(samples))
    for seed, own in enumerate((3.1234, 7.0, 12.3456)):
        z = size * np.sin(2 * math.pi * own * time + seed) + white(seed, samples)
        pieces = gather(NoisyRate(z, R, one_stretch(z), RATE_HZ))
        whole = spectrum(pieces, RATE_HZ)
        there = peak(whole, np.zeros(len(whole.frequency)))
        assert there.sharp
        line, left = sinusoid(pieces, RATE_HZ, there.frequency_hz)
        assert line.frequency_hz == pytest.approx(own, abs=limit)
        assert line.sd == pytest.approx(size / math.sqrt(2), rel=0.02)
        assert left[0].z.std() == pytest.approx(math.sqrt(R), rel=0.03)


@pytest.mark.parametrize("gyros", [2, 3, 6])
def test_a_line_of_one_gyro_is_noise(gyros):
    # Truth: a motion is in all gyros, with scale errors of 2 %; the hum of one gyro is in its own rate alone.
    samples, rng = 15_000, np.random.default_rng(gyros)
    wave = 0.3 * np.sin(2 * math.pi * 5.0 * np.arange(samples) / RATE_HZ)
    rates = poles(2, samples)[:, None] + 0.2 * rng.standard_normal((samples, gyros))
    one = np.zeros(gyros)
    one[1] = 1.0
    segment = one_stretch(rates)
    for share, expected in ((1 + 0.02 * rng.standard_normal(gyros), True), (one, False)):
        seen = rates + wave[:, None] * share
        shared = shared_lines(seen, segment, RATE_HZ)
        assert shared(5.0) is expected
        z = seen.mean(axis=1)
        motion = choose_motion(NoisyRate(z, 0.04 / gyros, segment, RATE_HZ), shared=shared)
        assert len(motion.lines) == expected


def test_no_lines_are_looked_for():
    z = np.sin(2 * math.pi * 5.0 * np.arange(5000) / RATE_HZ) + poles(1, 5000) + white(1, 5000)
    assert choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ), lines=False).lines == ()


def test_at_rest_a_vibration_is_passed_and_the_rest_is_in_the_deviation():
    """Known truth: at rest as a whole, a fixed bandwidth of 1 Hz. A line of .5 deg/s at 5 Hz is passed; broad motion of
    .1 deg/s between 5 and 15 Hz is lost, and known to be."""
    samples, fixed = 20_000, fixed_bandwidth(1.0, R, RATE_HZ)
    time, rng = np.arange(samples) / RATE_HZ, np.random.default_rng(2)
    lines = np.fft.rfft(rng.standard_normal(samples))
    frequency = np.fft.rfftfreq(samples, 1 / RATE_HZ)
    lines[(frequency < 5) | (frequency > 15)] = 0.0
    broad = np.fft.irfft(lines, samples)
    for truth, count, lost in (
        (0.0 * time, 0, 0.0),
        (0.7 * np.sin(2 * math.pi * 5.0 * time), 1, 0.0),
        (0.1 * broad / broad.std(), 0, 0.01),
    ):
        found = beside_fixed(NoisyRate(truth + white(5, samples), R, one_stretch(truth), RATE_HZ), fixed)
        assert len(found.lines) == count
        assert found.lost == pytest.approx(lost, rel=0.1, abs=1e-6)
    none = beside_fixed(NoisyRate(truth, R, one_stretch(truth), RATE_HZ), Motion("none", {}, RATE_HZ))
    assert (none.lines, none.lost) == ((), 0.0)


def test_nothing_to_smooth():
    # Truth: a rate that is white as far as it is seen. Its neighbours say nothing, and no model is to say otherwise.
    z = 10.0 * np.random.default_rng(3).standard_normal(4000)
    motion = choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ))
    assert np.std(smooth(NoisyRate(z, R, one_stretch(z), RATE_HZ), motion).rate - z) < 1.02 * math.sqrt(R)


def test_a_sinusoid_stays_one():
    z = 3.0 * np.sin(2 * math.pi * 0.7 * np.arange(6000) / RATE_HZ) + white(4, 6000)
    motion = choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ))
    assert motion.model == "oscillator"
    assert motion.parameters["damping"] <= NARROW


def test_what_the_choice_costs(monkeypatch):
    # Bounds, not seconds: one pass of the smoother over 16,384 samples at most where the first model stands, and as
    # much time as 40 transforms of the whole recording and 60 searches of the simplest model.
    z = poles(1, 45_000) + white(1, 45_000)
    passes, run = [], choice.engines.get("native").statespace.smooth
    monkeypatch.setattr(
        choice.engines.get("native").statespace,
        "smooth",
        lambda z, *others: passes.append(len(z)) or run(z, *others),
    )

    def cost(work):
        return min(cpu(work) for _ in range(3))

    def transforms():
        for _ in range(40):
            np.fft.rfft(z)
        for _ in range(60):
            search(bands, "random_walk", (), 0.0)

    bands = spectrum(gather(NoisyRate(z, R, one_stretch(z), RATE_HZ)), RATE_HZ).bands()
    choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ))
    assert passes == [choice.CHECKED]
    assert cost(lambda: choose_motion(NoisyRate(z, R, one_stretch(z), RATE_HZ))) < cost(transforms)


def cpu(work):
    begin = time.process_time()
    work()
    return time.process_time() - begin
