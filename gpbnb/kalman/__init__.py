"""A Kalman filter with every operation rounded: what (98)-(125) of hung1984, ch. II, promise, and what happens."""
