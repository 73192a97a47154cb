"""Offline work: benchmarks, training, data sets, fits and proof. No other package imports it."""
