"""Functions that differ between operating systems: files, locks, processes, signals, terminals.

Each function works on every system. It looks up a system's function by name; a process without that name behaves as on
the other system. docs/windows.md lists the tests on each system.
"""
