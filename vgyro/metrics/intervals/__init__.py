"""Intervals by resampling: moving blocks, and draws of a fitted noise model."""
