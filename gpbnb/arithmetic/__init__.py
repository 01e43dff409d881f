"""Correctly rounded arithmetic in any base and precision: formats, arrays, linear algebra and error bounds."""
