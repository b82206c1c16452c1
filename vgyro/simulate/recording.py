"""One recording of a twin: true rate → gyros with their errors → counts of the board → bytes of the dump."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.dataset import Plateau
from vgyro.errors import DataError
from vgyro.simulate.adc import channel_counts
from vgyro.simulate.encode import encode
from vgyro.simulate.faults import Faults, faults_of
from vgyro.simulate.line import Damage, damage
from vgyro.simulate.motion import plateaus_of, reference_rate
from vgyro.simulate.noise import (
    Volatility,
    White,
    correlation_matrix,
    modulated_white,
    pole_of_motion,
    pole_of_noise,
    unit_flicker,
    unit_random_walk,
)
from vgyro.simulate.twin import GyroTruth, Twin, TwinRecording, line_of, pole_of, temperature_of, truth_of
from vgyro.units import arw_deg_s_rt_hz, deg_s, rrw_deg_s_rt_s

MOTION, LINE, THERMOMETER, GYRO = range(4)
WHITE, FLICKER, WALK, BURST = range(4)
TRUTH_HZ = 10.0


@dataclass(frozen=True)
class Simulated:
    """A recording and its truth.

    time      : [T], s                       reference : [T], deg/s, true rate about the axis that turns
    rates     : [T, N], deg/s, what each gyro would show if its scale were known: before ADC, `stuck` and `dropout`
    counts    : channel → [T], what the board sends: whole numbers, but for channels that the board sends as floats
    bias      : [T, N], deg/s, slowly varying error (constant, flicker, random walk, temperature, drift and step faults)
    sd        : [M, N], deg/s/√Hz, density of the white noise in each second, √h; faults left out
    white_sd  : [T, N], deg/s a sample, of the white noise before the sensor's pole, faults in
    faulty    : [T, N], true while a fault is active
    temperature : [T], °C;   plateaus : of a rate table, settling left out
    """

    recording: str
    rate_hz: float
    gyros: tuple[str, ...]
    time: np.ndarray
    reference: np.ndarray
    rates: np.ndarray
    counts: dict[str, np.ndarray]
    bias: np.ndarray
    sd: np.ndarray
    white_sd: np.ndarray
    faulty: np.ndarray
    temperature: np.ndarray
    plateaus: tuple[Plateau, ...] = field(default=())


def simulate_recording(twin: Twin, board: Board, recording: str, seed: int | None = None) -> Simulated:
    """Make one recording; the same numbers whether alone or with the others.

    Every recording, gyro and kind of noise has a stream of its own, keyed by the names: adding a recording or a gyro
    changes no other.
    seed   : instead of the twin's
    raises : ConfigError if the twin has no such recording; DataError if it is too short to hold a sample
    """
    spec = twin.recording(recording)
    streams = _Streams(twin.seed if seed is None else seed, recording)
    rate_hz = spec.rate_hz or board.rate_hz
    samples = round(spec.duration * rate_hz)
    if samples < 2:
        raise DataError(f"recording {recording!r} of {spec.duration} s at {rate_hz} Hz holds {samples} samples")
    names = [gyro.name for gyro in board.gyros]
    truths = [truth_of(twin, spec, name) for name in names]
    time = np.arange(samples) / rate_hz
    reference = reference_rate(spec.motion, time, rate_hz, streams.of(MOTION))
    faults = faults_of(spec.faults, names, time, [streams.of(GYRO, name, BURST) for name in names])
    white = _white(twin, truths, names, samples, rate_hz, streams)
    thermal = temperature_of(twin, spec)
    temperature = thermal.start_c + thermal.rise_k * -np.expm1(-time / thermal.time_constant_s)
    bias = _slow(twin, truths, names, samples, rate_hz, streams)
    bias += np.outer(temperature - thermal.reference_c, [truth.temperature_coefficient for truth in truths])
    bias += faults.added_bias
    rates = _output(twin, board, spec, reference, white, faults, rate_hz) + bias
    rates *= faults.gain
    shown = temperature + thermal.noise_k * streams.of(THERMOMETER).standard_normal(samples)
    counts = channel_counts(board, rates, [truth.scale_error for truth in truths], shown, faults)
    white_sd = np.sqrt(rate_hz) * white.sd[white.block_index] * faults.noise_gain
    return Simulated(
        recording=recording,
        rate_hz=rate_hz,
        gyros=tuple(names),
        time=time,
        reference=reference,
        rates=rates,
        counts=counts,
        bias=bias,
        sd=white.sd,
        white_sd=np.hypot(white_sd, faults.burst_sd),
        faulty=faults.active,
        temperature=temperature,
        plateaus=plateaus_of(spec.motion),
    )


def dump_of(simulated: Simulated, board: Board, twin: Twin, seed: int | None = None) -> tuple[bytes, list[Damage]]:
    """The bytes that reach the disk, and what the line did to them.

    seed : instead of the twin's; the one given to simulate_recording
    """
    spec = twin.recording(simulated.recording)
    line = line_of(twin, spec)
    rows = np.arange(simulated.time.size)
    kept = np.ones(rows.size, dtype=bool)
    missing: list[tuple[int, int]] = []
    for start, stop in line.missing:
        gone = (simulated.time >= start) & (simulated.time < stop)
        kept &= ~gone
        if gone.any():
            missing.append((int(rows[gone][0]), int(gone.sum())))
    counts = {name: values[kept] for name, values in simulated.counts.items()}
    encoded = encode(board, spec.counter_start + rows[kept], counts, simulated.time[kept])
    generator = _Streams(twin.seed if seed is None else seed, simulated.recording).of(LINE)
    data, done = damage(encoded.data, line, generator, encoded.starts, rows[kept])
    for first, count in missing:
        before = int(encoded.starts[np.searchsorted(rows[kept], first) - 1])
        done.append(Damage("missing", before, first, f"{count} frames"))
    return data, sorted(done, key=lambda item: item.offset)


def truth_table(simulated: Simulated, board: Board, rate_hz: float = TRUTH_HZ) -> dict[str, Any]:
    """Columns of the `truth` schema, one row every 1/rate_hz s; a fault at any sample of a row counts."""
    step = max(round(simulated.rate_hz / rate_hz), 1)
    starts = np.arange(0, simulated.time.size, step)
    columns: dict[str, Any] = {"time": simulated.time[starts], "reference": simulated.reference[starts]}
    for index, gyro in enumerate(simulated.gyros):
        columns[f"bias_{gyro}"] = simulated.bias[starts, index]
        columns[f"sd_{gyro}"] = simulated.white_sd[starts, index]
        columns[f"fault_{gyro}"] = np.logical_or.reduceat(simulated.faulty[:, index], starts)
    for thermometer in board.temperatures:
        columns[f"temp_{thermometer.name}"] = simulated.temperature[starts]
    return columns


class _Streams:
    """Independent generators by name: SeedSequence with a spawn key made of the names' CRC-32 and the kind of noise."""

    def __init__(self, seed: int, recording: str) -> None:
        self._seed, self._recording = seed, zlib.crc32(recording.encode())

    def of(self, source: int, gyro: str = "", kind: int = 0) -> np.random.Generator:
        key = (self._recording, source, zlib.crc32(gyro.encode()), kind)
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=key))


def _white(
    twin: Twin, truths: list[GyroTruth], names: list[str], samples: int, rate_hz: float, streams: _Streams
) -> White:
    unit = np.column_stack([streams.of(GYRO, name, WHITE).standard_normal(samples) for name in names])
    alpha = np.array([truth.garch.alpha if truth.garch else 0.0 for truth in truths])
    beta = np.array([truth.garch.beta if truth.garch else 0.0 for truth in truths])
    density = np.array([arw_deg_s_rt_hz(truth.arw) for truth in truths])
    target = correlation_matrix(twin.correlation, len(names))
    a, b = (twin.dcc.a, twin.dcc.b) if twin.dcc else (0.0, 0.0)
    return modulated_white(unit, rate_hz, Volatility(density**2 * (1.0 - alpha - beta), alpha, beta, a, b, target))


def _slow(
    twin: Twin, truths: list[GyroTruth], names: list[str], samples: int, rate_hz: float, streams: _Streams
) -> np.ndarray:
    """Constant bias, flicker and rate random walk, [T, N], deg/s; the last two correlated by `slow_correlation`."""
    correlation = twin.correlation if twin.slow_correlation is None else twin.slow_correlation
    mixing = np.linalg.cholesky(correlation_matrix(correlation, len(names))).T
    b = np.array([deg_s(truth.bias_instability_deg_h) for truth in truths])
    k = np.array([rrw_deg_s_rt_s(truth.rrw_deg_h_rt_h) for truth in truths])
    slow = np.tile([truth.bias_deg_s for truth in truths], (samples, 1))
    if b.any():
        unit = np.column_stack([unit_flicker(samples, streams.of(GYRO, name, FLICKER)) for name in names])
        slow += b * (unit @ mixing)
    if k.any():
        unit = np.column_stack([unit_random_walk(samples, rate_hz, streams.of(GYRO, name, WALK)) for name in names])
        slow += k * (unit @ mixing)
    return slow


def _output(
    twin: Twin, board: Board, spec: TwinRecording, reference: np.ndarray, white: White, faults: Faults, rate_hz: float
) -> np.ndarray:
    """Rate and white noise behind the sensor's pole, [T, N]; only gyros on the axis that turns see the rate."""
    axis = spec.axis or board.axes[0]
    turning = np.array([gyro.axis == axis for gyro in board.gyros], dtype=float)
    noise = white.noise * faults.noise_gain + faults.burst
    pole = pole_of(twin, spec)
    if pole is not None:
        reference, noise = pole_of_motion(reference, pole, rate_hz), pole_of_noise(noise, pole, rate_hz)
    return np.outer(reference, turning) + noise
