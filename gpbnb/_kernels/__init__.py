"""Loops behind the arrays, one module a carrier."""
