"""Error sources, one physical cause per file, and their interface."""
