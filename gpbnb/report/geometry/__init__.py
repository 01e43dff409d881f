"""Measurement geometry: six frames, deroll, and how misalignments affect the drift (hung1982, ch. I and IV)."""
