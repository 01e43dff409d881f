"""Long computations: cells with seeds, progress, resume, any executor, and results stored with checksums.

``python -m gpbnb.sweeps verify`` computes a sample of every stored sweep again on this machine and compares.
"""

from gpbnb.sweeps.sweep import Difference, Sweep, machine
from gpbnb.sweeps.table import Column, DamagedFileError, Table, read, write

__all__ = ["Column", "DamagedFileError", "Difference", "Sweep", "Table", "machine", "read", "write"]
