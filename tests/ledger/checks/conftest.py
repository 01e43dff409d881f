"""What the tests of each topic's checks share: the findings on its statements, and faults seeded beneath its checks.

A test module names its statements ``ENTRIES`` and the modules that remember results ``CACHING``.
"""

import faults
import pytest


@pytest.fixture(scope="module")
def rows(request):
    """The statements of the topic with their findings."""
    return faults.examined(request.module.ENTRIES)


@pytest.fixture
def patch(request, monkeypatch):
    """Change the code, with nothing remembered; undone, and forgotten, afterwards."""
    with faults.forgetting(monkeypatch, *request.module.CACHING):
        yield monkeypatch
