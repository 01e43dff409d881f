"""A Kalman filter with every operation rounded: what (98)-(125) promise, what happens, and a bound (hung1984, ch. II)."""
