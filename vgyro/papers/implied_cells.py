"""For every published cell: the value that the equations imply with how it follows, or why none follows.

Inputs are numbers that the papers print; the formulas are those of vgyro.papers.implied.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vgyro.fusion import design
from vgyro.papers import implied as forms
from vgyro.papers.implied import Implied
from vgyro.papers.published import Paper, PublishedTable
from vgyro.units import arw_deg_rt_h, arw_deg_s_rt_hz, deg_s, rrw_deg_s_rt_s

Address = tuple[int | str, str, str]

# Settings that Jiang et al. (2012) print in sections 3.1, 3.3 and 3.4.
TAU, Q_STATIC, Q_DYNAMIC = 500.0, 0.0772, 1.9290
DYNAMIC_RATE_HZ, SENSOR_HZ = 500.0, 40.0
SINE_DEG_S, SINE_HZ = 62.8, 0.25
GYROS, READ_AT = 6, 1.0
# A correlation factor to show that the bandwidth depends on it.
STRONG = 0.5


def implied_cells(paper: Paper) -> dict[Address, Implied]:
    """Every numeric cell of the paper's tables → its Implied."""
    of: dict[str, Callable[[PublishedTable, str, str], Implied]] = {"jiang2012": _jiang(paper), "liu2015": _liu(paper)}
    return {
        (table.number, row.name, column.name): of[paper.name](table, row.name, column.name)
        for table in paper.tables
        for row in table.rows
        for column in table.columns
        if table.text(row.name, column.name) is not None
    }


def implied_figures(paper: Paper) -> dict[str, float]:
    """Figures that decide claims without any recording: name → value."""
    if paper.name == "jiang2012":
        d = _information(paper)
        correlated = design.information(forms.alike(_single_arw(paper), GYROS, STRONG))
        return {
            "bandwidth_gain_of_markov": design.bandwidth(d, Q_STATIC, TAU) / design.bandwidth(d, Q_STATIC) - 1.0,
            "bandwidth_ratio_of_correlation": design.bandwidth(correlated, Q_STATIC) / design.bandwidth(d, Q_STATIC),
        }
    names = {"Mean": "if_mean", "1σ": "if_sigma", "ARW": "if_arw", "Bias Drift": "if_bias_drift"}
    table = paper.table(3)
    return {
        name: float(_singles(table, column).mean() / table.number_at("DCC", column)) for column, name in names.items()
    }


def jiang_correlation(paper: Paper) -> np.ndarray:
    """J Table 1 as a matrix [6, 6]."""
    table = paper.table(1)
    return np.array([[float(text or "nan") for text in row] for row in table.values])


def _single_arw(paper: Paper) -> float:
    return arw_deg_s_rt_hz(paper.table(2).number_at("ARW", "Single gyroscope"))


def _information(paper: Paper) -> float:
    return design.information(forms.alike(_single_arw(paper), GYROS))


def _jiang(paper: Paper) -> Callable[[PublishedTable, str, str], Implied]:
    tables = {1: _jiang_correlation, 2: _jiang_static, 3: _jiang_dynamic}
    return lambda table, row, column: tables[int(table.number)](paper, row, column)


def _jiang_correlation(_paper: Paper, row: str, column: str) -> Implied:
    if row == column:
        return Implied(None, "1 by definition")
    return Implied(None, "measured on the authors' gyroscopes")


def _jiang_static(paper: Paper, row: str, column: str) -> Implied:
    table, arw = paper.table(2), _single_arw(paper)
    correlation = jiang_correlation(paper)
    factor, rho = forms.average_factor(correlation), forms.mean_correlation(correlation)
    single = column == "Single gyroscope"
    filtered = column in {"Random walk", "1st order Markov"}
    tau = TAU if column == "1st order Markov" else math.inf
    d = _information(paper)
    s, gain = design.pole(d, Q_STATIC, tau), design.dc_gain(d, Q_STATIC, tau) if filtered else 1.0
    white = arw if single else arw * factor
    how = "the printed ARW" if single else f"the printed ARW × √((1 + 5·{rho:.3f})/6), mean correlation of Table 1"
    if row == "Noise Density":
        return Implied(
            white * gain, f"{how}, / 60, two-sided" + (f"; gain {gain:.4f} at low frequency" if filtered else "")
        )
    if row == "ARW":
        drift_of = "Single gyroscope" if single else "Simple average"
        walk, minimum = table.number_at("RRW", drift_of), table.number_at("Bias Drift", drift_of)
        shape = design.allan_ratio(READ_AT, s) if filtered else 1.0
        read = gain * forms.allan_reading(white, rrw_deg_s_rt_s(walk), deg_s(minimum), shape, READ_AT)
        low_pass = f"; σ(1 s) behind a low-pass of s = {s:.3f} rad/s is {shape:.3f} of it" if filtered else ""
        return Implied(arw_deg_rt_h(read), f"{how}, and the printed drift, at 1 s{low_pass}")
    if single:
        return Implied(None, "a property of the authors' gyroscopes, from which the rest follows")
    if not filtered:
        return Implied(None, "the correlation of the drifts is not published")
    return Implied(
        table.number_at(row, "Simple average") * gain, f"that of the average × gain at zero frequency {gain:.4f}"
    )


def _jiang_dynamic(paper: Paper, row: str, column: str) -> Implied:
    arw, factor = _single_arw(paper), forms.average_factor(jiang_correlation(paper))
    tau = TAU if row == "1st order Markov" else math.inf
    d = _information(paper)
    s, gain = design.pole(d, Q_DYNAMIC, tau), design.dc_gain(d, Q_DYNAMIC, tau)
    if column == "Random rate: 1σ":
        return Implied(None, "the random rate is not published")
    if row == "Single gyroscope":
        return _jiang_single(column, forms.one_pole_sigma(arw, SENSOR_HZ))
    runs = forms.SampledFilter(s, 1.0 / DYNAMIC_RATE_HZ, gain, SENSOR_HZ)
    noise = runs.noise_sigma(arw * factor)
    bandwidth = f"bandwidth {design.bandwidth(d, Q_DYNAMIC, tau):.2f} Hz"
    if column == "Constant rate: Mean":
        mean = paper.table(3).number_at("Single gyroscope", column)
        return Implied(mean * runs.gain, f"mean of the single gyroscopes × gain {runs.gain:.5f}")
    if column == "Constant rate: 1σ":
        return Implied(noise, f"white noise of the average behind the 40 Hz pole and the filter, {bandwidth}")
    if column == "Sinusoidal rate: Amplitude":
        return Implied(SINE_DEG_S * abs(runs.response(SINE_HZ)), f"62.8 deg/s × |H(0.25 Hz)|, {bandwidth}")
    raw, aligned = (runs.sine_error_sigma(SINE_DEG_S, SINE_HZ, noise, flag) for flag in (False, True))
    whole = runs.sine_error_sigma(SINE_DEG_S, SINE_HZ, noise, aligned=False, chain=True)
    delay = f"{1000.0 * runs.delay(SINE_HZ):.0f} ms"
    how = (
        f"62.8 deg/s sine minus its filtered self, and the noise; {aligned:.3f} with the delay of {delay} removed; "
        f"{whole:.2f} with the one-sample delay of eq. 14 and the gyro's own pole on top"
    )
    return Implied(raw, how)


def _jiang_single(column: str, noise: float) -> Implied:
    if column == "Constant rate: Mean":
        return Implied(None, "bias and scale of the authors' gyroscopes")
    if column == "Sinusoidal rate: Amplitude":
        return Implied(SINE_DEG_S, "the rate that was set, 40°·2π·0.25 Hz as printed")
    return Implied(noise, "white noise of the printed ARW behind the 40 Hz pole")


def _singles(table: PublishedTable, column: str) -> np.ndarray:
    return np.array([table.number_at(row.name, column) for row in table.rows if row.name.startswith("Gyro ")])


def _liu(paper: Paper) -> Callable[[PublishedTable, str, str], Implied]:
    tables = {1: _liu_arch, 2: _liu_garch, 3: _liu_virtual, "text": _liu_text}
    return lambda table, row, column: tables[table.number](paper, row, column)


def _liu_arch(paper: Paper, row: str, column: str) -> Implied:
    if column == "P-Value":
        statistic = paper.table(1).number_at(row, "LM-Statistic")
        return Implied(forms.arch_lm_p(statistic), "the printed statistic under chi² with 1 degree of freedom")
    return Implied(None, "measured on the authors' record")


def _liu_garch(paper: Paper, row: str, column: str) -> Implied:
    if column != "α0: Value":
        return Implied(None, "estimated from the authors' record")
    table = paper.table(2)
    alpha, beta = table.number_at(row, "α: Value"), table.number_at(row, "β: Value")
    sigma = paper.table(3).number_at(row, "1σ")
    settled = forms.unconditional_sd(table.number_at(row, column), alpha, beta)
    how = f"1σ² of Table 3 × (1 - α - β); the printed α0 settles to {settled:.4f} deg/s, Table 3 prints {sigma:.4f}"
    return Implied(sigma**2 * (1.0 - alpha - beta), how)


def _liu_virtual(paper: Paper, row: str, column: str) -> Implied:
    table = paper.table(3)
    singles = _singles(table, column)
    if row.startswith("Gyro "):
        return Implied(None, "a property of the authors' gyroscopes, from which the rest follows")
    if row == "IF of DCC":
        return Implied(
            float(singles.mean() / table.number_at("DCC", column)),
            f"eq. 18 on the table itself: {singles.mean():.4g} / {table.text('DCC', column)}",
        )
    if row == "DCC":
        return _liu_dcc(column, singles)
    average = row == "Simple average"
    if column == "Mean":
        how = "mean of the six, all errors of one sign" + ("" if average else "; a filter of gain 1 passes it")
        return Implied(float(singles.mean()), how)
    if not average:
        if column == "Bias Drift":
            return Implied(
                table.number_at("Simple average", column), "that of the average: a filter of gain 1 passes drift"
            )
        return Implied(None, "the parameters of this filter are not published")
    if column == "Bias Drift":
        return Implied(None, "the correlation of the drifts is not published")
    rho = forms.correlation_of_average(singles, table.number_at(row, column))
    how = f"if the six were uncorrelated; the printed value needs a mean correlation of {rho:.3f}"
    return Implied(forms.uncorrelated_average(singles), how)


def _liu_dcc(column: str, singles: np.ndarray) -> Implied:
    if column == "Mean":
        return Implied(float(singles.min()), "at least this for fixed weights between 0 and 1 and errors of one sign")
    if column == "Bias Drift":
        return Implied(None, "the correlation of the drifts is not published")
    return Implied(forms.best_fixed_weights(singles), "the best fixed weights of uncorrelated gyroscopes")


def _liu_text(_paper: Paper, row: str, _column: str) -> Implied:
    return Implied(None, f"{row}: from the authors' record")
