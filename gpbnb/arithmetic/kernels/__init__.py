"""Compiled loops behind the arrays: one module per backend."""
