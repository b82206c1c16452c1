"""Sections on the recordings: how complete they are, their clocks, delays, series and faults."""
