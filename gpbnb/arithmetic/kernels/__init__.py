"""Loops behind the arrays, one module a backend."""
