"""Baselines: what every method must beat. Fixed weights, and weights from second moments."""
