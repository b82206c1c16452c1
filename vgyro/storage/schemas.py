"""What every Parquet artefact holds: columns, units, meaning. docs/file-formats.md is written from this file.

A column name may hold a placeholder: {gyro}, {channel}, {temperature} or {method} stands for every name of that sort.
The first column that fits a name describes it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from vgyro.figure import FLAGS


@dataclass(frozen=True)
class Column:
    """unit : "1" for a pure number, "" where a unit makes no sense (names, flags)"""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Schema:
    """One kind of table."""

    name: str
    version: int
    meaning: str
    columns: tuple[Column, ...]


_TIME = Column("time", "s", "since the first frame of the recording")
_SEGMENT = Column("segment", "", "number of the gap-free stretch, from 0")
_WINDOW = (
    Column("window", "", "number from 0; -1: the longest stretch without a gap, at most its first 1,000,000 samples"),
    Column("start", "", "first sample of the window in the volatility series"),
    Column("stop", "", "one past the last sample"),
    Column("time_start", "s", "time of the first sample"),
    Column("time_stop", "s", "time of the last sample"),
)

_ALL = (
    Schema("frames", 2, "decoded frames of one recording, or rows of its logs", (
        Column("counter", "", "frame counter without its wraps; row number where the board has none"),
        _TIME, _SEGMENT,
        Column("{channel}", "count", "value of a channel as sent, or deg/s for a log that holds rates; NaN: no value"),
    )),
    Schema("rates", 2, "calibrated rates of one recording; in the metadata also rate_hz, clipped, calibration and "
           "temperature by gyro, delays by axis, and where there are any missing and noise_gain by gyro, lost_rows by "
           "axis, moved", (
        _TIME, _SEGMENT,
        Column("at_rest", "", "true where the board is known to stand still"),
        Column("reference", "deg/s", "true rate, where it is known"),
        Column("temp_{temperature}", "°C", "temperature channel; NaN: no value"),
        Column("{gyro}", "deg/s", "rate along the gyro's axis; NaN: no value"),
    )),
    Schema("series", 1, "the series in which volatility is analysed: means of blocks of samples", (
        Column("time", "s", "time of the block's first sample"),
        _SEGMENT,
        Column("stretch", "", "number of the run without a missing block, within which windows lie"),
        Column("{gyro}", "deg/s", "mean rate of the block; at the full rate, the rate itself"),
    )),
    Schema("arch_lm", 1, "Engle's test for ARCH effects", (
        Column("gyro", "", "gyro"),
        Column("series", "", "level, detrended, whitened or standardised"),
        Column("lags", "", "lagged squares in the regression"),
        Column("samples", "", "samples of the series"),
        Column("statistic", "1", "LM statistic; NaN where it is not defined"),
        Column("p_value", "1", "probability under chi² with `lags` degrees of freedom"),
        Column("kurtosis", "1", "kurtosis, 3 for a Gaussian"),
        Column("status", "", "ok, too short, no variance"),
    )),
    Schema("effects", 1, "what an ARCH effect of each gyro's level is: changing variance, drift, a tone, or nothing", (
        Column("gyro", "", "gyro"),
        Column("verdict", "", "heteroskedastic, drift, tone at …, disturbance at …, correlation, nothing; or several"),
        Column("sentence", "", "the verdict in one sentence, with its evidence"),
        Column("p_level", "1", "ARCH-LM of the level"),
        Column("p_detrended", "1", "ARCH-LM without the running mean"),
        Column("p_whitened", "1", "ARCH-LM of the residuals of an autoregression, tones taken out"),
        Column("p_standardised", "1", "ARCH-LM of the standardised GARCH residuals"),
        Column("kurtosis", "1", "kurtosis of the whitened series, 3 for a Gaussian"),
        Column("tone_frequency", "Hz", "strongest tone that reaches the volatility series; NaN: none"),
        Column("tone_amplitude", "deg/s", "its amplitude in the rate"),
        Column("tone_seen_at", "Hz", "where it lies in the volatility series, aliased"),
    )),
    Schema("garch", 1, "GARCH(1,1) of each gyro in each window and in the longest stretch (window = -1)", (
        *_WINDOW,
        Column("gyro", "", "gyro"),
        Column("omega", "(deg/s)²", "constant α0"),
        Column("alpha", "1", "weight of the last squared value"),
        Column("beta", "1", "weight of the last variance"),
        Column("se_omega", "(deg/s)²", "robust standard error"),
        Column("se_alpha", "1", "robust standard error"),
        Column("se_beta", "1", "robust standard error"),
        Column("log_likelihood", "1", "Gaussian log-likelihood of the window"),
        Column("status", "", "converged, boundary: …, outlier-dominated, no variance, too short, failed"),
    )),
    Schema("dcc", 1, "DCC(1,1) and constant-correlation test of each window and the longest stretch (-1)", (
        *_WINDOW,
        Column("a", "1", "weight of the last outer product"),
        Column("b", "1", "weight of the last Q"),
        Column("se_a", "1", "two-step robust standard error"),
        Column("se_b", "1", "two-step robust standard error"),
        Column("se_a_hessian", "1", "inverse-Hessian standard error, margins taken as known"),
        Column("se_b_hessian", "1", "inverse-Hessian standard error, margins taken as known"),
        Column("log_likelihood", "1", "correlation part of the log-likelihood, DCC"),
        Column("log_likelihood_ccc", "1", "the same with a = b = 0"),
        Column("target", "1", "rows of S above the diagonal, as a list; NaN for a gyro without variance"),
        Column("statistic", "1", "constant-correlation test"),
        Column("p_value", "1", "its probability under chi²(s + 1)"),
        Column("p_value_s", "1", "its probability under chi²(s)"),
        Column("status", "", "converged, boundary: …, boundary margin, outlier-dominated, one gyro, …"),
    )),
    Schema("fits", 1, "how the fits of the rolling windows ended, over the recording", (
        Column("time_start", "s", "start of the bin; a window counts where its middle is"),
        Column("time_stop", "s", "end of the bin"),
        Column("subject", "", "gyro, or dcc"),
        Column("status", "", "as in garch and dcc"),
        Column("windows", "", "number of windows; none has no row"),
    )),
    Schema("weights", 2, "weights of each model and mode (`blocks` in the metadata), one row a sample of the series", (
        _TIME, _SEGMENT,
        Column("model", "", "dcc or ccc"),
        Column("mode", "", "in_sample or causal"),
        Column("sigma", "deg/s", "conditional standard deviation of the fused rate, √(w'Hw)"),
        Column("w_{gyro}", "1", "weight of the gyro"),
        Column("sd_{gyro}", "deg/s", "conditional standard deviation of the gyro, √h"),
        Column("status", "", "ok, or what was left out, or why the weights are equal"),
    )),
    Schema("faults", 2, "stretches in which one gyro is at fault", (
        Column("gyro", "", "gyro"),
        Column("kind", "", "drift, step, noise, burst, stuck, dropout, scale, dead, copy, outlier or clipped"),
        Column("start", "s", "time of its first sample"),
        Column("stop", "s", "time of its last sample"),
        Column("evidence", "1", "size over its standard error; infinite where the values alone show it"),
        Column("size", "see unit", "drift, step, outlier, ratio of noise, change of scale, end of range; NaN: none"),
        Column("unit", "", "unit of size"),
        Column("other", "", "gyro that a copy repeats; empty: of another kind"),
        Column("sentence", "", "the event in one sentence"),
    )),
    Schema("bekk", 1, "BEKK, DCC and CCC on a sample of windows", (
        *_WINDOW,
        Column("definition", "", "definition of r_t"),
        Column("model", "", "ccc, dcc, bekk_scalar or bekk_diagonal"),
        Column("parameters", "", "number of parameters"),
        Column("log_likelihood", "1", "Gaussian log-likelihood of the window"),
        Column("bic", "1", "Bayesian information criterion, less is better"),
        Column("sigma", "deg/s", "1σ of the fused r_t in the step after the window, weights carried on"),
        Column("status", "", "converged, boundary: …, too short, no variance, failed"),
    )),
    Schema("more_gyros", 1, "what more gyros of the same kind would bring (Jiang et al. 2012, eq. 21, fig. 3)", (
        Column("gyros", "", "number of gyros"),
        Column("correlation", "1", "correlation factor of every pair"),
        Column("measured", "", "true where it is the mean of this array"),
        Column("arw", "deg/s/√Hz", "angle random walk of the virtual gyro"),
        Column("sd", "deg/s", "√P∞ of the random-walk filter at the bandwidth of config"),
        Column("factor", "1", "improvement over one gyro"),
        Column("over_present", "1", "improvement over the present array; NaN for another correlation"),
    )),
    Schema("fused", 2, "one column a method", (
        _TIME, _SEGMENT,
        Column("sd_{method}", "deg/s", "posterior standard deviation of a sample of that method, where it has one"),
        Column("{method}", "deg/s", "virtual gyroscope of that method"),
    )),
    Schema("moved", 1, "virtual gyroscopes of the same recording with a constant rate added to every gyro, less it", (
        _TIME, _SEGMENT,
        Column("{method}", "deg/s", "error of the virtual gyroscope; only methods that answer to a constant rate"),
    )),
    Schema("methods", 4, "what ran, and what it is", (
        Column("method", "", "name in vgyro.fusion.METHODS"),
        Column("definition", "", "definition of r_t where the method has one"),
        Column("column", "", "column in fused.parquet; empty where the method could not run"),
        Column("state", "", "ran; cannot run, as the method found by itself; failed: it ended with an error"),
        Column("title", "", "name for people"),
        Column("source", "", "paper and equation; name and version of the package, where it is not vgyro"),
        Column("family", "", "baseline, paper, ours, or other: of another package"),
        Column("needs", "", "what it takes beside the rates"),
        Column("inferred", "", "what its paper does not say, and how it was filled in"),
        Column("operations", "1", "floating-point operations a sample, all passes; NaN: not counted"),
        Column("causal", "", "true if sample t uses nothing later than t"),
        Column("dc_gain", "1", "gain for a constant rate"),
        Column("bandwidth_hz", "Hz", "-3 dB bandwidth; NaN: not limited by the method"),
        Column("noise_bandwidth_hz", "Hz", "noise-equivalent bandwidth, one-sided; NaN: not limited"),
        Column("delay_s", "s", "delay at low frequency"),
        Column("passes", "", "passes of a first-order low-pass: 1 forward, 2 forward and back, 0 other shape or none"),
        Column("response", "", "how the four are known: analytic, or measured by adding a known motion"),
        Column("moved", "", "what a constant rate changes: column in moved.parquet, or why it changes nothing"),
        Column("note", "", "what was inferred, or why it could not run or failed"),
    )),
    Schema("allan", 2, "Allan deviations of every series", (
        Column("series", "", "gyro, or column of fused.parquet"),
        Column("kind", "", "overlapping; where asked for: modified, hadamard, robust"),
        Column("tau", "s", "averaging time"),
        Column("deviation", "deg/s", "Allan deviation"),
        Column("low", "deg/s", "lower confidence limit, chi²"),
        Column("high", "deg/s", "upper confidence limit, chi²"),
        Column("edf", "1", "equivalent degrees of freedom"),
    )),
    Schema("cross_allan", 1, "Allan covariance and correlation of every pair of gyros", (
        Column("gyro", "", "one gyro"),
        Column("other", "", "the other; the same: its Allan variance"),
        Column("tau", "s", "averaging time"),
        Column("covariance", "(deg/s)²", "half the mean product of the second differences"),
        Column("correlation", "1", "covariance over the product of the Allan deviations"),
        Column("low", "1", "lower confidence limit of the correlation"),
        Column("high", "1", "upper confidence limit of the correlation"),
    )),
    Schema("tones", 1, "narrow lines of the spectra of the gyros", (
        Column("gyro", "", "gyro"),
        Column("frequency", "Hz", "frequency of the line; it may be an alias of a higher one"),
        Column("amplitude", "deg/s", "amplitude of the sinusoid"),
        Column("low", "deg/s", "lower confidence limit"),
        Column("high", "deg/s", "upper confidence limit"),
        Column("probability", "1", "chance that noise makes one such line anywhere in the spectrum"),
        Column("shared", "", "gyros that have the same line, this one among them"),
    )),
    Schema("spectrum", 1, "Welch density of every series", (
        Column("series", "", "gyro, or column of fused.parquet"),
        Column("frequency", "Hz", "frequency"),
        Column("density", "deg/s/√Hz", "amplitude density, ONE-sided"),
    )),
    Schema("correlation", 1, "correlation matrix of the gyros' noise (Jiang et al. 2012, eq. 22)", (
        Column("gyro", "", "row"),
        Column("other", "", "column"),
        Column("correlation", "1", "correlation factor"),
        Column("low", "1", "lower confidence limit"),
        Column("high", "1", "upper confidence limit"),
    )),
    Schema("metrics", 3, "every figure, long", (
        Column("recording", "", "recording"),
        Column("axis", "", "axis of the array"),
        Column("method", "", "gyro, or name in vgyro.fusion.METHODS"),
        Column("definition", "", "definition of r_t where the method has one, else empty"),
        Column("true_rate", "deg/s", "constant rate added to a recording at rest; 0: the recording as it is"),
        Column("metric", "", "name of the figure (vgyro.metrics.FIGURES)"),
        Column("value", "see unit", "the figure"),
        Column("low", "see unit", "lower 95 % limit; NaN where none is given"),
        Column("high", "see unit", "upper 95 % limit; NaN where none is given"),
        Column("unit", "", "unit of value, low and high"),
        Column("note", "", "what to know before using it"),
        Column("flags", "", f"what decides how it is used, of: {', '.join(FLAGS)}"),
    )),
    Schema("crosscheck", 1, "sampled results computed again by an independent route", (
        Column("check", "", "what was compared"),
        Column("against", "", "the independent route"),
        Column("window", "", "window, -1 for a whole recording"),
        Column("series", "", "gyro or method"),
        Column("ours", "see unit", "our figure"),
        Column("theirs", "see unit", "the figure of the independent route"),
        Column("difference", "see unit", "ours - theirs"),
        Column("tolerance", "see unit", "largest difference that passes"),
        Column("unit", "", "unit of the four figures"),
        Column("passed", "", "true if |difference| <= tolerance; of two maxima, if difference >= -tolerance"),
    )),
    Schema("reference", 1, "logged true rate of a simulated recording", (
        _TIME,
        Column("rate", "deg/s", "true rate about the axis that turns"),
    )),
    Schema("truth", 1, "what a simulated recording really was", (
        _TIME,
        Column("reference", "deg/s", "true rate"),
        Column("bias_{gyro}", "deg/s", "slowly varying error of the gyro"),
        Column("sd_{gyro}", "deg/s", "standard deviation of the white part of its noise"),
        Column("fault_{gyro}", "", "true while a fault is active"),
        Column("temp_{temperature}", "°C", "true temperature"),
    )),
)  # fmt: skip

SCHEMAS = {schema.name: schema for schema in _ALL}


def units_of(schema: str, names: list[str]) -> dict[str, str]:
    """Unit of each column.  raises : KeyError if the schema declares no such column"""
    return {name: _declared(SCHEMAS[schema], name).unit for name in names}


def _declared(schema: Schema, name: str) -> Column:
    for column in schema.columns:
        pattern = re.sub(r"\\{\w+\\}", r".+", re.escape(column.name))
        if re.fullmatch(pattern, name):
            return column
    raise KeyError(f"schema {schema.name!r} declares no column {name!r}")
