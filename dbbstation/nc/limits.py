"""Limits of correction and chord error. Free of imports, so that help loads fast."""

LARGEST_CORRECTION_MM = 1.0
"""What a machine that works is off by at most. Beyond it a model is of another machine, or has a slip of the pen."""

LARGEST_ALLOWED_MM = 10.0
"""No option lifts the limit beyond this: whether fixtures are clear of the tool was looked at on the nominal path."""

CIRCLE_CHORD_MM = 5e-4
"""How far the moves of a compensated ball-bar program may leave its circle: 0.5 µm, half of what a ball bar's reading
repeats. At 1 m/s² LinuxCNC needs 0.28 µm of it on 150 mm at 1000 mm/min."""

CHORD_MM = 1e-4
"""Greatest distance between the straight commanded move and the curve that would take the tool exactly along the
wanted one: 0.1 µm, a tenth of what a ball bar repeats."""
