"""Sections on the virtual gyroscopes and on the noise that they are made from."""
