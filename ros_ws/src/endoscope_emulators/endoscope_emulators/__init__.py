"""Emulated servos, load cells, tracker and cables, for tests and benchmarks."""
