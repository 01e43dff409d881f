from __future__ import annotations

import pytest


@pytest.fixture(scope="module", autouse=True)
def compiled(loops_at_once: None) -> None:
    """Tests of this folder are about loops, however few numbers they compute."""
