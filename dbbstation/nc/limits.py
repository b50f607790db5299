"""How large a correction may be. Free of imports: the command line shows the numbers before anything is loaded."""

LARGEST_CORRECTION_MM = 1.0
"""What a machine that works is off by at most. Beyond it a model is of another machine, or has a slip of the pen."""

LARGEST_ALLOWED_MM = 10.0
"""No option lifts the limit beyond this: whether fixtures are clear of the tool was looked at on the nominal path."""
