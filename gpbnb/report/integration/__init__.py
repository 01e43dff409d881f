"""Digital integration of a band-limited random process (savage2016): its error in exact and in t-digit arithmetic."""
