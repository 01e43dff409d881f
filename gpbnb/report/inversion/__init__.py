"""Errors of the inverse of a matrix: hung1984, ch. II, and hung1982, ch. III, sections 10-11."""
