"""What the equations imply, against figures derived and checked apart from this code, and against simulation."""

import math

import numpy as np
import pytest

from vgyro.fusion import design
from vgyro.papers import implied as forms
from vgyro.papers import load_paper
from vgyro.papers.implied_cells import implied_cells, implied_figures, jiang_correlation

J, L = load_paper("jiang2012"), load_paper("liu2015")
CELLS = {paper.name: implied_cells(paper) for paper in (J, L)}
ARW = 6.17 / 60


def value(paper, *address):
    found = CELLS[paper.name][address].value
    assert found is not None
    return found


@pytest.mark.parametrize("paper", [J, L], ids=lambda paper: paper.name)
def test_every_cell_has_a_value_or_a_reason(paper):
    printed = {
        (table.number, row.name, column.name)
        for table in paper.tables
        for row in table.rows
        for column in table.columns
        if table.text(row.name, column.name) is not None
    }
    assert set(CELLS[paper.name]) == printed
    for cell in CELLS[paper.name].values():
        assert cell.how
        assert cell.value is None or math.isfinite(cell.value)


def test_jiang_static_design():
    # Hand derivation: D = 6/N², s = √(Dq), BW = s/2π, Allan ratio at 1 s.
    d = design.information(forms.alike(ARW, 6))
    s = design.pole(d, 0.0772, 500.0)
    assert d == pytest.approx(567.4, abs=0.05)
    assert s == pytest.approx(6.618, abs=5e-4)
    assert design.bandwidth(d, 0.0772, 500.0) == pytest.approx(1.053, abs=5e-4)
    assert design.allan_ratio(1.0, s) == pytest.approx(0.880, abs=5e-4)


@pytest.mark.parametrize(("q", "bandwidth"), [(0.0772, 1.0), (1.929, 5.0)])
def test_jiang_process_noises_are_round_bandwidths(q, bandwidth):
    # At the noise density of 0.1083 deg/s/√Hz, six uncorrelated gyros.
    assert design.bandwidth(6 / 0.1083**2, q, math.inf) == pytest.approx(bandwidth, rel=5e-4)


def test_jiang_markov_is_the_random_walk():
    assert implied_figures(J)["bandwidth_gain_of_markov"] == pytest.approx(5e-8, abs=0.5e-8)


def test_jiang_correlation_enters_the_bandwidth():
    # Eq. 6 and 19: D falls by 1 + 5ρ, the bandwidth by its root.
    assert implied_figures(J)["bandwidth_ratio_of_correlation"] == pytest.approx(1 / math.sqrt(3.5), rel=1e-6)


def test_jiang_mean_correlation_of_table_1():
    assert forms.mean_correlation(jiang_correlation(J)) == pytest.approx(0.259 / 15, abs=1e-12)


@pytest.mark.parametrize(
    ("column", "figure"),
    [("Single gyroscope", 6.18), ("Simple average", 2.64), ("Random walk", 2.32), ("1st order Markov", 2.32)],
)
def test_jiang_arw_as_read_at_one_second(column, figure):
    # The figures come from an hour of simulation, whose σ(1 s) is known to about half a per cent.
    assert value(J, 2, "ARW", column) == pytest.approx(figure, rel=0.006)


def test_jiang_low_pass_leaves_drift_alone():
    for row, average in (("RRW", 161.21), ("Bias Drift", 22.72)):
        assert value(J, 2, row, "Random walk") == average
        assert value(J, 2, row, "1st order Markov") == pytest.approx(average, rel=4e-4)


def test_jiang_short_time_constant_gives_the_printed_markov_column():
    # τ = 0.5 s: gain 0.71, and the average's figures fall to 1.72, 16.15 and 114.6.
    d = design.information(forms.alike(ARW, 6))
    s, gain = design.pole(d, 0.0772, 0.5), design.dc_gain(d, 0.0772, 0.5)
    assert gain == pytest.approx(0.71, abs=0.005)
    table = J.table(2)
    arw = table.number_at("ARW", "Simple average") * gain * design.allan_ratio(1.0, s)
    assert arw == pytest.approx(1.72, abs=0.005)
    assert table.number_at("Bias Drift", "Simple average") * gain == pytest.approx(16.15, abs=0.005)
    assert table.number_at("RRW", "Simple average") * gain == pytest.approx(114.6, abs=0.05)


@pytest.mark.parametrize("row", ["Random walk", "1st order Markov"])
def test_jiang_dynamic_table(row):
    assert value(J, 3, row, "Sinusoidal rate: Amplitude") == pytest.approx(62.73, abs=0.005)
    assert value(J, 3, row, "Sinusoidal rate: 1σ") == pytest.approx(2.04, abs=0.005)
    assert value(J, 3, row, "Constant rate: 1σ") == pytest.approx(0.167, abs=5e-4)


def test_jiang_sine_with_the_delay_removed():
    d = design.information(forms.alike(ARW, 6))
    runs = forms.SampledFilter(design.pole(d, 1.929), 1 / 500, 1.0, 40.0)
    noise = runs.noise_sigma(ARW * forms.average_factor(jiang_correlation(J)))
    assert runs.delay(0.25) == pytest.approx(0.029, abs=5e-4)
    assert runs.sine_error_sigma(62.8, 0.25, noise, aligned=True) == pytest.approx(0.174, abs=1e-3)


def test_sampled_filter_against_its_recursion():
    # The printed recursion run on a sine and on noise, without the one-sample delay.
    period, s, gain = 1 / 500, 33.0, 0.9
    runs = forms.SampledFilter(s, period, gain)
    time = np.arange(20_000) * period
    sine = 62.8 * np.sin(2 * np.pi * 0.25 * time)
    noise = np.random.default_rng(5).normal(0.0, 1.0 / math.sqrt(period), 400_000)
    phi = math.exp(-s * period)

    def run(series):
        out, state = np.empty(len(series)), 0.0
        for index, sample in enumerate(series):
            state = phi * state + gain * (1 - phi) * sample
            out[index] = state
        return out

    settled = slice(4000, None)
    filtered = run(sine)[settled]
    expected = np.abs(runs.response(0.25)) * 62.8 * np.sin(2 * np.pi * 0.25 * (time[settled] - runs.delay(0.25)))
    np.testing.assert_allclose(filtered, expected, atol=1e-6)
    error = np.std(filtered - sine[settled])
    assert runs.sine_error_sigma(62.8, 0.25, 0.0, aligned=False) == pytest.approx(error, rel=1e-3)
    # 400 000 samples hold some 13 000 independent ones: 1σ is known to 0.6 %.
    assert runs.noise_sigma(1.0) == pytest.approx(np.std(run(noise)), rel=0.02)


def test_one_pole_is_the_limit_of_a_fast_filter():
    assert forms.SampledFilter(1e9, 1e-12, 1.0, 40.0).noise_sigma(0.1) == pytest.approx(forms.one_pole_sigma(0.1, 40.0))


def test_flat_floor_gives_back_the_minimum():
    white, walk, floor = 0.1, 1e-3, 0.01
    tau = np.geomspace(1, 1e4, 20_001)
    curve = np.sqrt(white**2 / tau + floor**2 + walk**2 * tau / 3)
    assert forms.flat_floor(white, walk, curve.min()) == pytest.approx(floor, rel=1e-6)
    assert forms.allan_reading(white, walk, curve.min()) == pytest.approx(curve[0], rel=1e-9)


@pytest.mark.parametrize(("column", "factor"), [("Mean", 5.17), ("1σ", 2.98), ("ARW", 2.13), ("Bias Drift", 4.12)])
def test_liu_improvement_factors_by_the_tables_own_arithmetic(column, factor):
    assert value(L, 3, "IF of DCC", column) == pytest.approx(factor, abs=0.005)


def test_liu_printed_factor_of_bias_drift_is_not_its_arithmetic():
    assert L.table(3).number_at("IF of DCC", "Bias Drift") == 4.09
    assert np.mean([L.table(3).number_at(f"Gyro {n}", "Bias Drift") for n in range(1, 7)]) == pytest.approx(
        45.40, abs=5e-3
    )


def test_liu_garch_settles_to_the_1_sigma_of_five_gyros():
    table = L.table(2)
    agree = []
    for row in table.rows:
        omega, alpha, beta = (table.number_at(row.name, f"{name}: Value") for name in ("α0", "α", "β"))
        settled = forms.unconditional_sd(omega, alpha, beta)
        # α and β carry six digits, α0 three: the s.d. is known to about one per cent where α + β is near 1.
        agree.append(settled == pytest.approx(L.table(3).number_at(row.name, "1σ"), rel=0.012))
    assert agree == [True, True, True, False, True, True]


def test_liu_average_arw_needs_a_correlation():
    singles = np.array([L.table(3).number_at(f"Gyro {n}", "ARW") for n in range(1, 7)])
    assert forms.correlation_of_average(singles, 1.03) == pytest.approx(0.117, abs=5e-4)
    # The inverse: gyros with that correlation have that average.
    covariance = np.outer(singles, singles) * 0.117
    np.fill_diagonal(covariance, singles**2)
    assert math.sqrt(covariance.sum()) / 6 == pytest.approx(1.03, abs=1e-3)


def test_liu_dcc_mean_is_below_every_single_mean():
    assert value(L, 3, "DCC", "Mean") == 0.0066
    assert L.table(3).number_at("DCC", "Mean") < 0.0066


def test_best_fixed_weights_against_the_weights_themselves():
    singles = np.array([1.0, 2.0, 4.0])
    weights = singles**-2 / (singles**-2).sum()
    assert forms.best_fixed_weights(singles) == pytest.approx(math.sqrt((weights**2 * singles**2).sum()))


def test_liu_p_values_follow_from_the_statistics():
    for number in range(1, 7):
        assert value(L, 1, f"Gyro {number}", "P-Value") < 5e-5
    # chi²(1) has 5 % beyond 3.8415 (tables).
    assert forms.arch_lm_p(3.8415) == pytest.approx(0.05, abs=1e-5)
