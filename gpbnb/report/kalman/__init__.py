"""The Kalman filter of hung1984, ch. II: its derivation, its bounds, and filters that exceed them."""
