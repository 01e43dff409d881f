from __future__ import annotations

import gc
import os
from collections.abc import Iterator

# Read when numpy is first imported, here and by the kernels of the notebooks. Threads wait in loops for each other,
# which takes more seconds than they save if there is a process of tests on every core.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import matplotlib
import pytest

from gpbnb.arithmetic.kernels import backends

# Modules and collected tests stay to the end. Python would look through them again and again for what nothing uses.
gc.disable()

# Set here, not in the environment, which the kernels of the notebooks inherit: they draw inline.
matplotlib.use("Agg")


def pytest_report_header(config: pytest.Config) -> list[str]:
    left_out = config.option.markexpr == "not long"
    return ["long tests are left out: -m long runs them alone, -m '' with the others"] if left_out else []


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(50_000)
    gc.enable()


@pytest.fixture(scope="module")
def loops_at_once() -> Iterator[None]:
    """Compile a loop for its first numbers, which exact arithmetic would else compute."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(backends, "LOOPS_AFTER", 0)
        yield
