"""Runs that are no circle of this machine and balls off their place: found, named, set free."""
