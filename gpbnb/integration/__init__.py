"""Digital integration of a band-limited random process (savage2016): its error, exactly, and in t-digit arithmetic."""
