"""Sections on the calibration: a certificate for each axis."""
