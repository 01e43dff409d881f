"""The error budget: classes of errors, their sum, and a list of your own (hung1982, ch. I and II; hung1984, ch. I)."""
