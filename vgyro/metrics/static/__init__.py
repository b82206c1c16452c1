"""Figures of a test at rest."""
