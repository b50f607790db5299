"""dbbstation: measure a hexapod machine tool with a double ball bar, calibrate it, find what its model lacks."""

__version__ = "0.1.0"
