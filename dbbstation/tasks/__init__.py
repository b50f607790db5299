"""One file a task: paths or objects in, a typed result out, for commands, station and scripts."""
