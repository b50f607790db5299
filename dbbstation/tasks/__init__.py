"""One file a task: paths or loaded objects go in, a typed result comes out. Commands, the station and Python scripts call these."""
