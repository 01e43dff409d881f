"""Measurement geometry: six frames, deroll, and what misalignments do to the drift (hung1982, ch. IV; ch. I)."""
