"""All that differs between operating systems: files, locks, processes, signals, terminals.

Each module has one function for every system. A system's own function is looked up by name, so that a process without
that name behaves as on the other system. docs/windows.md lists what has run on which.
"""
