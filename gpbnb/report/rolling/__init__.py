"""Roll and deroll: how rolling the spacecraft affects 1/f noise, and what errors of the roll cost."""
