"""Order of names, and safe output to a terminal."""
