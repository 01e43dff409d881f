"""Find the wordlength for a reader's own filter, integrator or matrix; this package combines the topics."""
