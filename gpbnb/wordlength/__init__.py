"""How many digits do you need? The chapter for a reader's own filter, integrator or matrix, above the topics."""
