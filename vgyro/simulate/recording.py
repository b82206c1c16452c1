"""One recording of a twin: true rate → gyros with their errors → counts of the board → bytes of the dump."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from vgyro.arrays import Floats
from vgyro.board import Board
from vgyro.dataset import Plateau
from vgyro.errors import DataError
from vgyro.simulate.adc import AdcConverter
from vgyro.simulate.faults import Faults, Stretch, faults_of, stretches_of
from vgyro.simulate.motion import ReferenceRate, plateaus_of
from vgyro.simulate.noise import (
    ModulatedWhite,
    Pole,
    UnitRandomWalk,
    Volatility,
    White,
    correlation_matrix,
    pole_of_motion,
    pole_of_noise,
    unit_flicker,
)
from vgyro.simulate.rows import row_at
from vgyro.simulate.transfer import Direction, Transfer, temperature_at, thermal_bias
from vgyro.simulate.twin import GyroTruth, Twin, TwinRecording, pole_of, temperature_of, truth_of
from vgyro.units import arw_deg_s_rt_hz, deg_s, earth_rate_deg_s, rrw_deg_s_rt_s

MOTION, LINE, THERMOMETER, GYRO = range(4)
WHITE, FLICKER, WALK, BURST = range(4)
PIECE = 1 << 18  # samples of a piece, about
TRUTH_HZ = 10.0


@dataclass(frozen=True)
class Simulated:
    """A recording, or a piece of it that begins at row `first`, and its truth.

    time      : [T], s                       reference : [T], deg/s, true rate about the axis that turns
    rates     : [T, N], deg/s, what each gyro would show if its scale were known: before ADC, `stuck` and `dropout`
    counts    : channel → [T], what the board sends: whole numbers, but for channels that the board sends as floats
    bias      : [T, N], deg/s, slowly varying error (constant, flicker, random walk, temperature, drift and step faults)
    sd        : [M, N], deg/s/√Hz, density of the white noise in each second, √h; faults left out
    white_sd  : [T, N], deg/s a sample, of the white noise before the sensor's pole, faults in
    faulty    : [T, N], true while a fault is active
    temperature : [T], °C;   plateaus : of a rate table, settling left out
    stretches : faults of the whole recording
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
    stretches: tuple[Stretch, ...] = field(default=())
    first: int = 0


def simulate_recording(twin: Twin, board: Board, recording: str, seed: int | None = None) -> Simulated:
    """Make one recording, whole; see simulate_pieces."""
    pieces = list(simulate_pieces(twin, board, recording, seed))
    joined: dict[str, Any] = {}
    for name in (item.name for item in fields(Simulated)):
        values = [getattr(piece, name) for piece in pieces]
        if isinstance(values[0], np.ndarray):
            joined[name] = np.concatenate(values)
    counts = {name: np.concatenate([piece.counts[name] for piece in pieces]) for name in pieces[0].counts}
    return replace(pieces[0], counts=counts, **joined)


def simulate_pieces(twin: Twin, board: Board, recording: str, seed: int | None = None) -> Iterator[Simulated]:
    """Make one recording, piece by piece; the same numbers whether alone or with the others.

    Every recording, gyro and kind of noise has a stream of its own, keyed by the names: adding a recording or a gyro
    changes no other.
    seed   : instead of the twin's
    raises : ConfigError if the twin has no such recording; DataError if it is too short to hold a sample
    """
    maker = _Maker(twin, board, recording, seed)
    first = 0
    while first < maker.samples:
        stop = maker.end_of_piece(first)
        yield maker.piece(first, stop)
        first = stop


def rows_of(twin: Twin, board: Board, recording: str) -> tuple[int, float]:
    """Samples of a recording, and how many there are a second.  raises : DataError if there are fewer than two"""
    spec = twin.recording(recording)
    rate_hz = spec.rate_hz or board.frame_rate_hz
    samples = round(spec.duration * rate_hz)
    if samples < 2:
        raise DataError(f"recording {recording!r} of {spec.duration} s at {rate_hz} Hz holds {samples} samples")
    return samples, rate_hz


def truth_table(simulated: Simulated, board: Board, rate_hz: float = TRUTH_HZ) -> dict[str, Any]:
    """Columns of the `truth` schema, one row every 1/rate_hz s; a fault at any sample of a row counts."""
    step = max(round(simulated.rate_hz / rate_hz), 1)
    starts = np.arange(-simulated.first % step, simulated.time.size, step)
    columns: dict[str, Any] = {"time": simulated.time[starts], "reference": simulated.reference[starts]}
    rows = starts + simulated.first
    for index, gyro in enumerate(simulated.gyros):
        columns[f"bias_{gyro}"] = simulated.bias[starts, index]
        columns[f"sd_{gyro}"] = simulated.white_sd[starts, index]
        faulty = np.zeros(rows.size, dtype=bool)
        for stretch in simulated.stretches:
            faulty |= (stretch.gyro == index) & (rows < stretch.last) & (rows + step > stretch.first)
        columns[f"fault_{gyro}"] = faulty
    for thermometer in board.temperatures:
        columns[f"temp_{thermometer.name}"] = simulated.temperature[starts]
    return columns


class Streams:
    """Independent generators by name: SeedSequence with a spawn key made of the names' CRC-32 and the kind of noise."""

    def __init__(self, seed: int, recording: str) -> None:
        self._seed, self._recording = seed, zlib.crc32(recording.encode())

    def of(self, source: int, gyro: str = "", kind: int = 0) -> np.random.Generator:
        """The generator of one source of chance."""
        key = (self._recording, source, zlib.crc32(gyro.encode()), kind)
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=key))


class _Maker:
    """All that goes on from one piece of a recording to the next."""

    def __init__(self, twin: Twin, board: Board, recording: str, seed: int | None) -> None:
        self.samples, self._rate_hz = rows_of(twin, board, recording)
        self._twin, self._board, self._spec = twin, board, twin.recording(recording)
        streams = Streams(twin.seed if seed is None else seed, recording)
        self._names = [gyro.name for gyro in board.gyros]
        truths = [truth_of(twin, self._spec, name) for name in self._names]
        self._motion = ReferenceRate(self._spec.motion, self.samples, self._rate_hz, streams.of(MOTION))
        self._stretches = stretches_of(
            self._spec.faults,
            self._names,
            self.samples,
            self._rate_hz,
            lambda name, nth: streams.of(GYRO, name, BURST + nth),
        )
        self._white = [streams.of(GYRO, name, WHITE) for name in self._names]
        self._modulated = ModulatedWhite(self._rate_hz, _volatility(twin, truths))
        self._slow = _Slow(twin, truths, self._names, self.samples, self._rate_hz, streams)
        self._truths = truths
        self._thermal, self._thermometer = temperature_of(twin, self._spec), streams.of(THERMOMETER)
        self._output = _Output(twin, board, self._spec, self._rate_hz, truths)
        self._converter = AdcConverter(board, [truth.scale_error for truth in truths], self._stretches)

    def end_of_piece(self, first: int) -> int:
        """Pieces are whole seconds."""
        seconds = max(int(PIECE / self._rate_hz), 1)
        second = round(first / self._rate_hz) + seconds
        return min(row_at(second - 1e-9, self._rate_hz), self.samples)

    def piece(self, first: int, stop: int) -> Simulated:
        """Rows [first, stop), which must follow the piece before."""
        samples, thermal = stop - first, self._thermal
        time = np.arange(first, stop) / self._rate_hz
        reference = self._motion.at(time, first)
        faults = faults_of(self._stretches, len(self._names), time, first)
        unit = np.column_stack([generator.standard_normal(samples) for generator in self._white])
        white = self._modulated.next(unit)
        temperature = temperature_at(thermal, time)
        bias = self._slow.piece(first, stop)
        bias += thermal_bias(self._truths, temperature - thermal.reference_c)
        bias += faults.added_bias
        rates = self._output.piece(reference, white, faults, temperature) + bias
        rates *= faults.gain
        shown = temperature + thermal.noise_k * self._thermometer.standard_normal(samples)
        white_sd = np.sqrt(self._rate_hz) * white.sd[white.block_index] * faults.noise_gain
        return Simulated(
            recording=self._spec.name,
            rate_hz=self._rate_hz,
            gyros=tuple(self._names),
            time=time,
            reference=reference,
            rates=rates,
            counts=self._converter.counts(rates, shown, first),
            bias=bias,
            sd=white.sd,
            white_sd=np.hypot(white_sd, faults.burst_sd),
            faulty=faults.active,
            temperature=temperature,
            plateaus=plateaus_of(self._spec.motion),
            stretches=tuple(self._stretches),
            first=first,
        )


def _volatility(twin: Twin, truths: list[GyroTruth]) -> Volatility:
    alpha = np.array([truth.garch.alpha if truth.garch else 0.0 for truth in truths])
    beta = np.array([truth.garch.beta if truth.garch else 0.0 for truth in truths])
    density = np.array([arw_deg_s_rt_hz(truth.arw) for truth in truths])
    target = correlation_matrix(twin.correlation, len(truths))
    a, b = (twin.dcc.a, twin.dcc.b) if twin.dcc else (0.0, 0.0)
    return Volatility(density**2 * (1.0 - alpha - beta), alpha, beta, a, b, target)


class _Slow:
    """Constant bias, flicker and rate random walk, deg/s; the last two correlated by `slow_correlation`."""

    def __init__(
        self, twin: Twin, truths: list[GyroTruth], names: list[str], samples: int, rate_hz: float, streams: Streams
    ) -> None:
        correlation = twin.correlation if twin.slow_correlation is None else twin.slow_correlation
        self._mixing = np.linalg.cholesky(correlation_matrix(correlation, len(names))).T
        self._bias = [truth.bias_deg_s for truth in truths]
        self._b = np.array([deg_s(truth.bias_instability_deg_h) for truth in truths])
        self._k = np.array([rrw_deg_s_rt_s(truth.rrw_deg_h_rt_h) for truth in truths])
        # Flicker has no end of memory: it is made whole, 4 bytes a sample and gyro.
        self._flicker = [unit_flicker(samples, streams.of(GYRO, name, FLICKER)) for name in names if self._b.any()]
        self._walks = [UnitRandomWalk(rate_hz, streams.of(GYRO, name, WALK)) for name in names if self._k.any()]

    def piece(self, first: int, stop: int) -> np.ndarray:
        """Rows [first, stop) of all gyros, [T, N]."""
        slow = np.tile(self._bias, (stop - first, 1))
        if self._flicker:
            unit = np.column_stack([flicker[first:stop].astype(float) for flicker in self._flicker])
            slow += self._b * (unit @ self._mixing)
        if self._walks:
            unit = np.column_stack([walk.next(stop - first) for walk in self._walks])
            slow += self._k * (unit @ self._mixing)
        return slow


class _Output:
    """Rate and white noise behind the sensor's pole, and what the gyros make of the rate.

    Gyros on the axis that turns see the rate, and that of the Earth where the latitude is known; the others see their
    `cross_axis` of it.
    """

    def __init__(
        self, twin: Twin, board: Board, spec: TwinRecording, rate_hz: float, truths: Sequence[GyroTruth]
    ) -> None:
        axis = spec.axis or board.axes[0]
        turning = [gyro.axis == axis for gyro in board.gyros]
        self._seen = np.array([1.0 if on else truth.cross_axis for on, truth in zip(turning, truths, strict=True)])
        self._earth = 0.0 if twin.latitude_deg is None else earth_rate_deg_s(twin.latitude_deg)
        full_scale = [gyro.range_deg_s or 1.0 for gyro in board.gyros]
        self._transfer = Transfer(truths, full_scale, temperature_of(twin, spec).reference_c)
        self._direction = Direction()
        pole = pole_of(twin, spec)
        self._poles: tuple[Pole, Pole] | None = None
        if pole is not None:
            self._poles = pole_of_motion(pole, rate_hz), pole_of_noise(pole, rate_hz)

    def piece(self, reference: Floats, white: White, faults: Faults, temperature: Floats) -> Floats:
        """The next piece, [T, N]."""
        noise = white.noise * faults.noise_gain + faults.burst
        direction = self._direction.next(reference)
        if self._poles is not None:
            reference, noise = self._poles[0].next(reference), self._poles[1].next(noise)
        rate = np.outer(reference + self._earth, self._seen)
        if self._transfer.ideal:
            piece: Floats = rate + noise
            return piece
        piece = rate + noise + self._transfer.error(rate, direction, temperature)
        return piece
