"""Stages of pages: one of a data set, and the overview."""
