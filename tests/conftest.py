from __future__ import annotations

import matplotlib

# Set here, not in the environment, which the kernels of the notebooks inherit: they draw inline.
matplotlib.use("Agg")
