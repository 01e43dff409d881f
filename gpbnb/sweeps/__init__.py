"""Sweeps, which are long computations in cells: with seeds, progress, resumption, any executor, and checked results.

``python -m gpbnb.report.stored`` lists the stored sweeps, verifies a sample of them, or computes them again.
"""

from gpbnb.sweeps.numbers import plain_integer, plain_number
from gpbnb.sweeps.record import read_record, write_record
from gpbnb.sweeps.sweep import Difference, Sweep, machine
from gpbnb.sweeps.table import Column, DamagedFileError, StoredTable, read, write

__all__ = [
    "Column",
    "DamagedFileError",
    "Difference",
    "StoredTable",
    "Sweep",
    "machine",
    "plain_integer",
    "plain_number",
    "read",
    "read_record",
    "write",
    "write_record",
]
