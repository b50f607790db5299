"""What operating systems do differently: files, locks, processes, signals, terminals. Nothing else in the program asks them.

Each module has one function for every system. A function of one system alone is looked for by its name, so that a process without
these names runs as on the other system. docs/windows.md lists what has run on which.
"""
