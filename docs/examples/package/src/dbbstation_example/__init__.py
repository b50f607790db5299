"""One of each: an instrument, a simulator, an error source and an NC dialect."""
