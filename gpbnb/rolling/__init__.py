"""Roll and deroll: what rolling the spacecraft does to 1/f noise, and what its errors cost."""
