"""Error sources without a cause: curves of a strut error over length or force, and waves along the screw."""
