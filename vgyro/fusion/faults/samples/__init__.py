"""Faults that single samples show: no rate, a copy, the end of a range, an absurd value."""
