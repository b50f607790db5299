"""Limits of correction and chord error. The module imports nothing, so that help loads fast."""

LARGEST_CORRECTION_MM = 1.0
"""Largest error of a working machine. With a larger correction the model belongs to another machine, or has a typing error."""

LARGEST_ALLOWED_MM = 10.0
"""Largest limit that an option may set: fixtures were checked for collisions on the nominal path only."""

CIRCLE_CHORD_MM = 5e-4
"""Largest distance of the moves of a compensated ball-bar program from its circle: 0.5 µm, half of a ball bar's repeatability. At 1 m/s² LinuxCNC needs 0.28 µm of it on 150 mm at 1000 mm/min."""

CHORD_MM = 1e-4
"""Greatest distance between the straight commanded move and the curve that would move the tool exactly along the wanted path: 0.1 µm, a tenth of a ball bar's repeatability."""
