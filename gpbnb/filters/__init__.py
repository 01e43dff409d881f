"""Filters as models and as programs of rounded operations, and their runs."""
