"""Stages of volatility: series, windows, effects, BEKK."""
