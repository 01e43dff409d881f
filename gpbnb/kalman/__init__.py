"""A Kalman filter with every operation rounded, compared with the bounds (98)-(125) of hung1984, ch. II."""
