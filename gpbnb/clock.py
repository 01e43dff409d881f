"""The time when this process imported the package: a source that changed later may not be the code that runs."""

import time

IMPORTED = time.time()
"""Seconds since 1970, before any other module of the package was imported."""
