"""Four white gyros whose biases are random walks of very different size, for the filters that estimate both."""

import math
from dataclasses import replace

import numpy as np

ARW = np.array([0.05, 0.1, 0.1, 0.3])
RRW = np.array([0.4, 0.02, 0.1, 0.05])
CORRELATION = np.array([[1, 0.2, -0.1, 0], [0.2, 1, 0.3, 0.1], [-0.1, 0.3, 1, 0.05], [0, 0.1, 0.05, 1]])


def walking(make_array, truth_of):
    """make(samples, …): an array of them;  truth_of(rng, samples) : the true rate [T], deg/s."""

    def make(samples, arw=ARW, rrw=RRW, correlation=CORRELATION, seed=3, **more):
        rng = np.random.default_rng(seed)
        truth = truth_of(rng, samples)
        array = make_array(samples, arw, correlation=correlation, seed=seed, truth=truth, **more)
        steps = rng.standard_normal((samples, len(arw))) @ np.linalg.cholesky(correlation).T
        walk = np.cumsum(steps * rrw * math.sqrt(array.period), axis=0)
        return replace(array, rate=array.rate + walk, noise=replace(array.noise, rrw=np.asarray(rrw)))

    return make
