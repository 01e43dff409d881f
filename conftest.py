"""Settings for every test and notebook that pytest runs here."""

import gc
import os
import re

import pytest

try:
    from xdist.scheduler import LoadScopeScheduling
except ImportError:
    LoadScopeScheduling = object

# Stored outputs have no such notice, and nbval would miss or find it, depending on what was compiled before.
os.environ.setdefault("GPBNB_QUIET", "1")

# What takes longest, longest first: with several processes none of it is left over at the end.
LONGEST = (
    "book/wordlength.ipynb",
    "book/rolling.ipynb",
    "book/nonlinear.ipynb",
    "book/integration.ipynb",
    "book/geometry.ipynb",
    "book/inversion.ipynb",
    "tests/filters/test_blocks.py",
    "tests/bounds/test_certificates.py",
    "tests/guarantees/test_guarantees_filters.py",
    "tests/filters/test_nonlinear.py",
    "tests/test_types.py",
    "alterations of hung1984.II",
    "tests/wordlength/test_code.py",
    "tests/arithmetic/kernels/test_kernels_compiling.py",
    "tests/arithmetic/test_arithmetic_special.py",
    "tests/bounds/test_guarantee.py",
    "tests/wordlength/test_precision.py",
    "tests/arithmetic/test_arithmetic_traced.py",
    "tests/sweeps/test_sweeps_sweep.py",
    "tests/wordlength/test_code_of_steps.py",
    "tests/arithmetic/kernels/test_kernels_paths.py",
    "tests/arithmetic/kernels/test_kernels_scalar.py",
    "tests/arithmetic/test_arithmetic_processors.py",
    "tests/filters/test_structures.py",
    "tests/ledger/test_ledger_command.py",
    "tests/test_execute_notebooks.py",
    "tests/gravity_probe_b/test_year.py",
)

MOST_PROCESSES = 8

# An opened page is looked at on a desktop, then on a phone, and is printed last.
OPENED = re.compile(r"(.+?\.html)-(desktop|phone|paper)\b")
LOOKS = ("", "desktop", "phone", "paper")


def group(nodeid):
    """What one process is to run: a file; a chapter whose statements are altered; all tests of an opened page.

    The other tests of pages need nothing of each other.
    """
    file, _, rest = nodeid.partition("::")
    name, _, parameters = rest.partition("[")
    if file.endswith("test_alterations.py"):
        chapter = re.match(r"\w+\.\w+", parameters)
        # Chapter III of 1982 prints most of chapter II of 1984, and their checks compute the same.
        return f"alterations of {chapter[0].replace('hung1982.III', 'hung1984.II')}" if chapter else file
    if file.endswith("pages/test_pages.py"):
        page = OPENED.match(parameters)
        return page[1] if page else name
    return file


# After pytest's own order, which knows of no groups.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    first = {}

    def place(numbered):
        number, item = numbered
        name = group(item.nodeid)
        look = OPENED.match(item.nodeid.partition("[")[2])
        rank = LONGEST.index(name) if name in LONGEST else len(LONGEST)
        return rank, first.setdefault(name, number), LOOKS.index(look[2] if look else ""), number

    items[:] = [item for _, item in sorted(enumerate(items), key=place)]


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """Look for garbage less often, and not among the modules and tests, which stay: saves 6 % of the time."""
    gc.freeze()
    gc.set_threshold(20_000, 50, 50)


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Share notebooks among the processors unless told how: a process executes one cell at a time."""
    option = config.option
    alone = getattr(option, "numprocesses", 0) is None and not hasattr(config, "workerinput")
    if alone and getattr(option, "nbval", False) and not option.usepdb:
        option.numprocesses, option.dist = min(os.cpu_count() or 1, MOST_PROCESSES), "loadgroup"


# pytest-xdist has --dist loadgroup, whose groups pytest 9.2 does not let it write into the names of tests.
class Groups(LoadScopeScheduling):
    def _split_scope(self, nodeid):
        return group(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    return Groups(config, log) if config.getvalue("dist") == "loadgroup" else None
