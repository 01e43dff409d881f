"""Settings for every test and notebook that pytest runs here."""

import os

import pytest

# Stored outputs have no such notice, and nbval would miss or find it, depending on what was compiled before.
os.environ.setdefault("GPBNB_QUIET", "1")

# What takes longest, longest first: with several processes none of it is left over at the end.
LONGEST = (
    "tests/kalman/test_kalman_filter_run.py",
    "alterations of kalman",
    "tests/ledger/checks/test_kalman_checks.py",
    "tests/kalman/test_kalman_guarantee.py",
    "tests/wordlength/test_wordlength.py",
    "tests/ledger/test_ledger_cache.py",
    "tests/ledger/checks/test_rounding_checks.py",
    "tests/ledger/checks/test_inversion_checks.py",
    "alterations of inversion",
    "alterations of rounding",
    "tests/test_execute_notebooks.py",
    "tests/ledger/test_ledger_command.py",
)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Keep a file in one process (``--dist loadgroup``), if its tests do not name groups of their own."""
    for item in items:
        if item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))
    items.sort(key=_rank)


def _rank(item):
    group = item.get_closest_marker("xdist_group").args[0]
    return LONGEST.index(group) if group in LONGEST else len(LONGEST)
