"""Bounds of rounding errors: of one run, of every admissible run, and of an inverse."""
