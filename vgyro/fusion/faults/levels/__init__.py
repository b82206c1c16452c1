"""Faults of the level: steps and drifts, and what a healthy level does besides."""
