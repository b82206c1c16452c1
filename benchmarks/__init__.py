"""Benchmarks: the native engine against the libraries, interleaved in one run. `python -m benchmarks --help`"""
