"""One file per task: a task reads paths or objects and returns a typed result, for commands, station and scripts."""
