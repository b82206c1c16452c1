"""Which model of the rate, with which parameters: by maximum likelihood, then by the error of the smoother itself.

The likelihood is the score of a filter: each sample given those before it. A rate is of no model exactly, and then the
parameters that filter best are not those that smooth best: of motion limited to a band they smooth too little. So the
models that are most likely are tuned, and compared, by an unbiased estimate of the smoother's squared error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vgyro.config import MOTION_MODELS
from vgyro.errors import DataError
from vgyro.fusion.motion_calibration import calibration
from vgyro.fusion.motion_evidence import Evidence, gather
from vgyro.fusion.motion_models import Likelihood, Motion

NO_GAIN = 0.01
"""A motion that raises the log-likelihood by less is none."""
GRID = 0.35
"""Step of the first search over the frequency at which rate and noise are alike, decades."""
TRIES = 200
"""Evaluations of the likelihood of one search over several parameters."""
HIGHEST_DAMPING = 20.0
HIGHEST = 0.2
"""Frequency of an oscillation over the sample rate: what is faster is the noise's own colour."""
FINALISTS = 2
NEAR = {"q": 1e4, "tau_s": 1e3, "sd": 1e2, "frequency_hz": 3.0, "second_hz": 3.0, "damping": 1e4, "second_damping": 1e4}
"""How far from the most likely parameters those that smooth best are looked for, as a factor either way."""
FIRST_STEP = {"q": -1.5, "tau_s": 0.5, "sd": -0.3, "frequency_hz": 0.1, "second_hz": 0.1}
NARROW = 1e-4
"""Damping of an oscillation that is a sinusoid: no second oscillator drives it."""
FLAT = {
    "frequency_hz": (0.63, "frequency_hz"), "damping": (0.3, ""), "second_hz": (1.48, "frequency_hz"),
    "second_damping": (0.04, ""), "sd": (1.0, "sd"),
}  # fmt: skip
"""Two oscillators that fit a flat band best, in units of what the best single one has."""
CERTAIN = 100.0
"""Log-likelihood over that of a constant rate from which on a second oscillator is worth a search."""
STRONG = 8.0
"""Lines of a periodogram that are certainly not noise, over its density."""

Parameters = dict[str, float]


def choose_motion(
    z: np.ndarray,
    r: float | np.ndarray,
    segment: np.ndarray,
    rate_hz: float,
    phi: float = 0.0,
    models: Sequence[str] = MOTION_MODELS,
    engine: str = "native",
    moving: np.ndarray | None = None,
) -> Motion:
    """The model of the rate that smooths best, of those that are most likely.

    z, r, segment, rate_hz, phi : as in vgyro.fusion.smoother.smooth;  moving : [T] bool, only these samples count
    models : names of those to choose from
    Each model has the parameters of its greatest likelihood. Of the FINALISTS of smallest BIC the parameters are then
    tuned to the smallest estimated error, in units of the noise, and the model of the smallest
    error + (parameters)·ln(samples) is taken; in doubt, by less than ln(samples), the most likely one. A constant rate
    is a legal answer: q = 0.
    Of more than 2^14 samples, four windows of 2^12 samples spread over the recording are used, and means of blocks of
    the whole of it, about 2^13, whose model is exact (but for the correlation of coloured noise between blocks); their
    scores are added. The likelihood is that given the first 16 samples of each stretch: no model pays for not knowing
    where it starts. The search is the native engine's; another one gives the log-likelihoods of the table.
    raises : DataError if the samples do not change, or if r is not above zero; TooShort
    """
    evidence = gather(z, r, segment, rate_hz, phi, moving)
    fits = sorted((_row(model, _FITS[model](evidence), evidence) for model in models), key=lambda row: row.bic)
    finalists = [_tuned(row, evidence) for row in fits[:FINALISTS]]
    rows = {row.model: row for row in fits[FINALISTS:] + finalists}
    if engine != evidence.engine:
        rows = {name: _checked(row, evidence, engine) for name, row in rows.items()}
    table = tuple(rows[model] for model in models)
    doubt = math.log(fits[0].samples)
    for best in sorted(finalists, key=lambda row: row.risk + _penalty(row) + doubt * (row.model != fits[0].model)):
        motion = Motion(best.model, best.tuned, rate_hz, table)
        factor = calibration(motion, evidence)
        if math.isfinite(best.risk) and factor is not None:
            return replace(motion, calibration=factor)
    raise DataError("no motion model fits: every smoother breaks down", remedy="look for outliers in rate and noise")


def _row(model: str, parameters: Parameters, evidence: Evidence, engine: str = "") -> Likelihood:
    total, count = evidence.log_likelihood(model, parameters, engine)
    row = Likelihood(model, total, math.inf, parameters, count)
    return replace(row, bic=_penalty(row) - 2.0 * total)


def _penalty(row: Likelihood) -> float:
    # The frequency counts twice: it is the best of as many lines as there are samples.
    free = len(row.parameters) + ("frequency_hz" in row.parameters) - (row.parameters.get("q") == 0.0)
    return free * math.log(row.samples)


def _checked(row: Likelihood, evidence: Evidence, engine: str) -> Likelihood:
    again = _row(row.model, dict(row.parameters), evidence, engine)
    return replace(row, log_likelihood=again.log_likelihood, bic=again.bic)


def _tuned(row: Likelihood, evidence: Evidence) -> Likelihood:
    """With the smallest error, near the parameters of the greatest likelihood. A sinusoid stays as it is."""
    start = {name: value for name, value in row.parameters.items() if value > 0.0}
    best = dict(row.parameters)
    if start and row.parameters.get("damping", 1.0) > NARROW:
        bounds = {name: (value / NEAR[name], value * NEAR[name]) for name, value in start.items()}
        fixed = {name: value for name, value in row.parameters.items() if name not in start}

        def score(parameters: Parameters) -> float:
            return -0.5 * evidence.risk(row.model, parameters)

        found = _search(score, [start], bounds, fixed, FIRST_STEP)
        best = found if score(found) > score(best) else best
    return replace(row, risk=evidence.risk(row.model, best), tuned=best)


def _driven(model: str, order: int) -> Callable[[Evidence], Parameters]:
    """Fit of a rate whose derivative of this order is white: a grid over the frequency f at which rate and noise have
    the same density, q = N²·(2π·f)^(2·order), then Brent's search between its best neighbours."""

    def fit(evidence: Evidence) -> Parameters:
        from scipy.optimize import minimize_scalar

        def parameters(log: float) -> Parameters:
            return {"q": evidence.noise_density * (2.0 * math.pi * math.exp(log)) ** (2 * order)}

        def cost(log: float) -> float:
            return -evidence.log_likelihood(model, parameters(log))[0]

        lowest, highest = math.log(0.03 / evidence.duration_s), math.log(evidence.rate_hz)
        grid = np.linspace(lowest, highest, math.ceil((highest - lowest) / (GRID * math.log(10.0))) + 1)
        costs = [cost(log) for log in grid.tolist()]
        best = int(np.argmin(costs))
        bounds = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, len(grid) - 1)]))
        found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-3})
        still = -evidence.log_likelihood(model, {"q": 0.0})[0]
        return {"q": 0.0} if still <= found.fun + NO_GAIN else parameters(float(found.x))

    return fit


def _markov(evidence: Evidence) -> Parameters:
    """Starts at the random walk q = 2·sd²/τ with the variance that the rate has beside its noise."""
    q = _FITS["random_walk"](evidence)["q"]
    sd = math.sqrt(evidence.excess)
    tau = 2.0 * sd**2 / q if q > 0 else 0.1 * evidence.duration_s

    def likelihood(parameters: Parameters) -> float:
        return evidence.log_likelihood("markov", parameters)[0]

    bounds = {"tau_s": (0.1 / evidence.rate_hz, 1e4 * evidence.duration_s), "sd": (1e-6 * sd, 1e6 * sd)}
    return _search(likelihood, [{"tau_s": tau, "sd": sd}], bounds, {}, {})


def _oscillator(evidence: Evidence) -> Parameters:
    """About a constant; then, each where it is worth its parameters, about a random walk, and driven by another one.

    Starts narrow at the highest line of the periodogram, and wide at the r.m.s. frequency of the rate.
    """
    line, centre = _frequencies(evidence)
    sd, fastest = math.sqrt(evidence.excess), HIGHEST * evidence.rate_hz
    hertz, losses = (0.01 / evidence.duration_s, fastest), (1e-9, HIGHEST_DAMPING)
    bounds = {"frequency_hz": hertz, "damping": losses, "sd": (1e-6 * sd, 1e6 * sd)}
    starts = [{"frequency_hz": line, "damping": 0.02, "sd": sd}, {"frequency_hz": centre, "damping": 0.5, "sd": sd}]

    def likelihood(parameters: Parameters) -> float:
        return evidence.log_likelihood("oscillator", parameters)[0]

    found = [_search(likelihood, starts, bounds, {"q": 0.0}, {})]
    slow = evidence.noise_density * (2.0 * math.pi * min(0.1 * found[0]["frequency_hz"], 1.0)) ** 2
    wider = bounds | {"q": (1e-12 * slow, 1e6 * slow)}
    found.append(_search(likelihood, [found[0] | {"q": slow}], wider, {}, {}))
    still = evidence.log_likelihood("random_walk", {"q": 0.0})[0]
    certain = likelihood(found[0]) - still > CERTAIN
    if certain and NARROW < found[0]["damping"] < 1.0:
        start = {name: value * found[0].get(of, 1.0) for name, (value, of) in FLAT.items()}
        near = (0.1 * found[0]["frequency_hz"], min(10.0 * found[0]["frequency_hz"], fastest))
        wider = bounds | dict.fromkeys(("frequency_hz", "second_hz"), near)
        wider |= dict.fromkeys(("damping", "second_damping"), (1e-3, 2.0))
        found.append(_search(likelihood, [start], wider, {}, {}))
    return min(found, key=lambda parameters: _row("oscillator", parameters, evidence).bic)


def _search(
    score: Callable[[Parameters], float],
    starts: list[Parameters],
    bounds: Mapping[str, tuple[float, float]],
    fixed: Parameters,
    first_step: Mapping[str, float],
) -> Parameters:
    """Greatest score over the logarithms of the parameters, by Nelder & Mead from each start, then again from the best
    place."""
    from scipy.optimize import minimize

    names = list(bounds)
    lowest, highest = np.log(np.array([bounds[name] for name in names])).T
    steps = np.diag([first_step.get(name, 0.7) for name in names])

    def parameters(logs: np.ndarray) -> Parameters:
        return dict(zip(names, np.exp(np.clip(logs, lowest, highest)).tolist(), strict=True)) | fixed

    def cost(logs: np.ndarray) -> float:
        outside = float(np.sum(np.maximum(lowest - logs, 0.0) + np.maximum(logs - highest, 0.0)))
        return -score(parameters(logs)) + 1e3 * outside

    def run(start: np.ndarray, size: float) -> tuple[float, np.ndarray]:
        simplex = np.vstack([start, start + size * steps])
        options = {"initial_simplex": simplex, "maxfev": TRIES, "xatol": 0.02, "fatol": NO_GAIN}
        found = minimize(cost, start, method="Nelder-Mead", options=options)
        return float(found.fun), found.x

    logs = [np.clip(np.log([start[name] for name in names]), lowest, highest) for start in starts]
    value, place = min((run(one, 1.0) for one in logs), key=lambda found: found[0])
    again, other = run(place, -0.4)
    return parameters(other if again < value else place)


def _frequencies(evidence: Evidence) -> tuple[float, float]:
    """Highest line of the periodograms, and r.m.s. frequency of the lines above the noise, Hz."""
    best, moments = (0.0, 1.0 / evidence.duration_s), np.zeros(2)
    for one in evidence.series:
        told = np.isfinite(one.r)
        mean = float(np.mean(one.z[told]))
        window = np.hanning(len(one.z))
        power = np.abs(np.fft.rfft(np.where(told, one.z - mean, 0.0) * window)) ** 2
        frequency = np.fft.rfftfreq(len(one.z), one.size / evidence.rate_hz)
        # Of white noise alone, and of the sum over a line of amplitude A, A²/4·(Σ window)²
        noise = float(np.mean(one.r[told])) * float(np.sum(window**2))
        power, frequency = np.where(power > STRONG * noise, power, 0.0)[1:-1], frequency[1:-1]
        moments += [float(np.sum(power * frequency**2)) / noise, float(np.sum(power)) / noise]
        highest = int(np.argmax(power))
        best = max(best, (float(power[highest]) / float(np.sum(window)) ** 2, float(frequency[highest])))
    centre = math.sqrt(moments[0] / moments[1]) if moments[1] > 0 and moments[0] > 0 else best[1]
    return best[1], centre


_FITS: dict[str, Callable[[Evidence], Parameters]] = {
    "random_walk": _driven("random_walk", 1),
    "acceleration": _driven("acceleration", 2),
    "jerk": _driven("jerk", 3),
    "oscillator": _oscillator,
    "markov": _markov,
}
