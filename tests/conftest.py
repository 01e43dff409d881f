from __future__ import annotations

import matplotlib
import pytest

# Set here, not in the environment, which the kernels of the notebooks inherit: they draw inline.
matplotlib.use("Agg")

# Failed assertions of the helpers beside this file tell what came, as those of the tests do.
pytest.register_assert_rewrite("steps")
