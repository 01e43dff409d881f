"""Compiled loops for the filter, its simulation and its contraction bound, written once for every arithmetic."""
