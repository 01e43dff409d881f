"""The report: one package for each chapter of the book, none of which the library imports."""
