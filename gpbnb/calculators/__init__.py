"""Calculators of the book: the chapters' SymPy expressions, translated to JavaScript that runs in the page.

Like the ledger, this package imports the topics. :mod:`~gpbnb.calculators.derivation` collects the expressions,
:mod:`~gpbnb.calculators.javascript` prints them, :mod:`~gpbnb.calculators.forms` defines inputs and results, and
:mod:`~gpbnb.calculators.page` writes the HTML.
"""
