"""Rounding and data-reduction errors of Gravity Probe B, number by number.

Start with :class:`gpbnb.formats.FloatFormat`; each topic of the book has a sub-package of its name.
"""

__version__ = "0.1.0"
