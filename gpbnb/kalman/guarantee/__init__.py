"""Bound the effect of rounding on an estimate, for every admissible measurement sequence and for all time."""
