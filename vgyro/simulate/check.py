"""Mistakes of a twin that only show when it is read together with its board."""

from __future__ import annotations

from vgyro.board import Board
from vgyro.complaints import did_you_mean
from vgyro.simulate.twin import EVERY_GYRO, Rest, Twin
from vgyro.validation import Problem

OF_FULL_SCALE = ("nonlinearity_ppm", "hysteresis_ppm")


def check_against_board(twin: Twin, board: Board, source: str) -> list[Problem]:
    """Mistakes that only show when twin and board are read together."""
    names = [gyro.name for gyro in board.gyros]
    problems = []

    def known(gyro: str, key: str) -> None:
        if gyro not in (*names, EVERY_GYRO):
            problems.append(
                Problem(source, 1, key, f"board {board.name!r} has no gyro {gyro!r}{did_you_mean(gyro, names)}")
            )

    for gyro in twin.gyros:
        known(gyro, f"gyros.{gyro}")
    for key, value in (("correlation", twin.correlation), ("slow_correlation", twin.slow_correlation)):
        problem = _matrix_problem(value, len(names))
        if problem:
            problems.append(Problem(source, 1, key, problem))
    for index, recording in enumerate(twin.recordings):
        for gyro in recording.gyros:
            known(gyro, f"recordings.{index}.gyros.{gyro}")
        for number, fault in enumerate(recording.faults):
            known(fault.gyro, f"recordings.{index}.faults.{number}.gyro")
            if fault.start >= recording.duration:
                message = f"begins at {fault.start} s, after the end of the recording at {recording.duration} s"
                problems.append(Problem(source, 1, f"recordings.{index}.faults.{number}", message))
        if recording.axis is not None and recording.axis not in board.axes:
            problems.append(
                Problem(
                    source, 1, f"recordings.{index}.axis", f"{recording.axis!r} is not one of {', '.join(board.axes)}"
                )
            )
        if recording.axis is None and len(board.axes) > 1 and not isinstance(recording.motion, Rest):
            message = f"says no axis for its motion; the board has {', '.join(board.axes)}"
            problems.append(Problem(source, 1, f"recordings.{index}", message))
    return problems + _range_problems(twin, board, source)


def _range_problems(twin: Twin, board: Board, source: str) -> list[Problem]:
    """A figure in ppm of full scale, of a gyro whose range the board does not say."""
    endless = {gyro.name for gyro in board.gyros if gyro.range_deg_s is None}
    problems = []
    places = [("gyros", twin.gyros)] + [(f"recordings.{i}.gyros", r.gyros) for i, r in enumerate(twin.recordings)]
    for place, gyros in places:
        for name, truth in gyros.items():
            for key in OF_FULL_SCALE:
                if getattr(truth, key) and endless & ({name} if name != EVERY_GYRO else endless):
                    message = f"is of full scale, and board {board.name!r} gives no range_deg_s"
                    problems.append(Problem(source, 1, f"{place}.{name}.{key}", message))
    return problems


def _matrix_problem(value: float | tuple[tuple[float, ...], ...] | None, gyros: int) -> str | None:
    import numpy as np

    if value is None:
        return None
    if isinstance(value, float):
        lowest = -1.0 / (gyros - 1) if gyros > 1 else -1.0
        return None if value > lowest else f"{value:g} for every pair of {gyros} gyros must be above {lowest:g}"
    if {len(row) for row in value} != {gyros} or len(value) != gyros:
        return f"expected {gyros} rows of {gyros} numbers, one for each gyro of the board"
    matrix = np.array(value)
    if not np.array_equal(matrix, matrix.T) or not np.all(np.diag(matrix) == 1):
        return "a correlation matrix is symmetric and has 1 on its diagonal"
    if np.linalg.eigvalsh(matrix).min() <= 0:
        return "not positive definite: no set of gyros can be correlated like this"
    return None
