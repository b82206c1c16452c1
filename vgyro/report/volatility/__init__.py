"""Sections on volatility: ARCH effects, the fits of the windows, alternatives to DCC."""
