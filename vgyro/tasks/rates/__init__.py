"""Stages from files to rates."""
