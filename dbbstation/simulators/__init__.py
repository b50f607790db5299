"""Users' simulators: read, run in processes, written as code."""
