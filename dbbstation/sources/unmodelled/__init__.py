"""Error sources without cause: curves over length or force, and waves."""
