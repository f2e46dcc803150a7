"""Runs beside runs: scenarios with their bounds, ablations, two sets of results; their tables."""
