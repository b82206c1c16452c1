"""Boards with known truth ("twins"), down to the bytes of a dump and its damage. See docs/twins.md."""

from vgyro.simulate.calibration_truth import calibration_truth, repeatability_truth, thermal_truth
from vgyro.simulate.check import check_against_board
from vgyro.simulate.closed_form import allan_minimum, expected_allan
from vgyro.simulate.manifest import dump_name, manifest_of, manifest_yaml, reference_name
from vgyro.simulate.recording import Simulated, simulate_pieces, simulate_recording
from vgyro.simulate.serial.dump import Dump, dump_of
from vgyro.simulate.serial.encode import encode_frames
from vgyro.simulate.serial.line import DamageDone, damage
from vgyro.simulate.twin import GyroTruth, Twin, lasting, parse_twin, truth_of

__all__ = [
    "DamageDone",
    "Dump",
    "GyroTruth",
    "Simulated",
    "Twin",
    "allan_minimum",
    "calibration_truth",
    "check_against_board",
    "damage",
    "dump_name",
    "dump_of",
    "encode_frames",
    "expected_allan",
    "lasting",
    "manifest_of",
    "manifest_yaml",
    "parse_twin",
    "reference_name",
    "repeatability_truth",
    "simulate_pieces",
    "simulate_recording",
    "thermal_truth",
    "truth_of",
]
