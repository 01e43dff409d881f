"""Calculators of the book: the chapters' sympy expressions, made into JavaScript that runs in the page.

Like the ledger, they stand above the topics and import them. :mod:`~gpbnb.calculators.derivation` collects the
expressions, :mod:`~gpbnb.calculators.javascript` prints them, :mod:`~gpbnb.calculators.forms` says what is asked and
shown, and :mod:`~gpbnb.calculators.page` writes the HTML.
"""
