"""Rounding bounds: from one operation to chains of matrix products (hung1984, ch. II, sections 1-9)."""
