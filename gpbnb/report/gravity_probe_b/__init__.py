"""Gravity Probe B's filter for a year: models, runs, thresholds and probabilities."""
