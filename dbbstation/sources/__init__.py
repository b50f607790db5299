"""Error sources: one physical cause per file, and the contract that they share."""
