"""The stage papers."""
