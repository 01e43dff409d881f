"""``python -m gpbnb.rolling``: simulate the years of all gyros again, and write ``drift_rates.csv``."""

from pathlib import Path

from gpbnb.rolling.stored import SWEEP

if __name__ == "__main__":
    SWEEP.store(SWEEP.run(Path(".cache/drift_rates")))
