"""Compiled loops of the filter, its simulation and its contraction bound, written once for every arithmetic."""
