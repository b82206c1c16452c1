"""Stages of fusion: noise, faults, virtual gyroscopes."""
