"""Accuracy of every fusion method on simulated recordings whose truth is known: `python -m benchmarks.accuracy`."""
