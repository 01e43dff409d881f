from __future__ import annotations

from contextlib import nullcontext

import pytest

from gpbnb.filters.replayed import only_compiled


@pytest.fixture(autouse=True, scope="module")
def compiled_loops(request):
    """Short runs take the compiled loops, too, which these tests are about, except where they are compared."""
    with nullcontext() if request.module.__name__.endswith("test_replayed") else only_compiled():
        yield
