"""Figures of a test with a known true rate."""
