from __future__ import annotations

import matplotlib.pyplot as plt
import pytest


@pytest.fixture(autouse=True)
def _close():
    """Close the figures of a test after it."""
    yield
    plt.close("all")
