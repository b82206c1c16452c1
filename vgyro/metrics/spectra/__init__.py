"""Amplitude densities and the lines in them."""
