"""A virtual machine and instrument for trials, demonstrations and tests."""
