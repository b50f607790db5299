"""Read, check and write YAML, with the line and column of every node."""
