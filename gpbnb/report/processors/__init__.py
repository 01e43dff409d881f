"""Filters on processors: fused operations, wide accumulators and other orders of addition."""
