"""Readers of binary logs, one family a module."""
