"""Calculators of the book: the chapters' SymPy expressions, translated to JavaScript that runs in the page.

Like the ledger, this package imports the topics. :mod:`~gpbnb.report.calculators.derivation` collects the expressions,
:mod:`~gpbnb.report.calculators.javascript` prints them, :mod:`~gpbnb.report.calculators.forms` defines inputs and
results, and :mod:`~gpbnb.report.calculators.page` writes the HTML.
"""
