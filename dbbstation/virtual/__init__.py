"""A machine and an instrument that are not there: what the package is tried on, shown with and tested against."""
