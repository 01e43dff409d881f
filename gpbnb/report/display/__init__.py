"""How results are shown: figure style, tables and derivation steps."""
