"""Noise with heavy tails: its density, and how much each sample counts."""
