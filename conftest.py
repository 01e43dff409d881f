"""Settings for every test and notebook that pytest runs here."""

import os

# Stored outputs have no such notice, and nbval would miss or find it, depending on what was compiled before.
os.environ.setdefault("GPBNB_QUIET", "1")
