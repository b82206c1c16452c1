"""Stages of figures: measured, and cross-checked."""
