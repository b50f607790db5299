"""Distortion of the jig plate by clamping."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, ErrorSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

REACH_MM = 100.0
"""Distance from the plate's origin at which heights are stated [mm]."""


class JigDistortion(ErrorSource):
    """Clamping changes the plate's height by w(x, y), and holders tilt with its slope.

    With r = 100 mm, w = a (x² + y²)/r² + b (x² - y²)/r² + c 2 x y/r². These constant curvatures follow from moments
    along the edges (Kirchhoff); x and y are machine axes. A ball at height h above the middle surface moves by (-h
    dw/dx, -h dw/dy, w); h = z + d, and d is this surface's depth below the jig's origin. Shift and tilt at the origin
    are zero, because the plate defines the machine's coordinates.
    """

    name = "jig-distortion"
    belongs_to = Owner.SESSION
    form_uncertainty = 0.2  # a clamped plate bends in more ways than one
    texts = Texts(
        what="Clamps, or a chip under the plate, bend the jig plate: its bores rise or sink and its holders lean.",
        shows="Tests at the outer bores are shifted, at long holders and risers sideways and most; a bow sends opposite "
        "bores apart or together. Nothing is deformed, nor shifted in the middle.",
        confirm="Run a dial gauge over the plate while the clamps are loosened and tightened: it must not move by more "
        "than a micrometre. Or measure the plate on the CMM clamped in the same way.",
        cure="Clamp at three points above three supports, lightly; clean plate and table.",
        equation="db = (-h dw/dx, -h dw/dy, w), w = a (x² + y²)/r² + b (x² - y²)/r² + c 2xy/r², h = z + d, r = 100 mm",
        origin="pure bending of a thin plate with constant curvatures, Timoshenko and Woinowsky-Krieger, Theory of Plates "
        "and Shells, chapter 2",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter("bow_um", "µm", 5.0, "height of the plate 100 mm from its origin all round, minus CMM"),
            Parameter("saddle_um", "µm", 5.0, "further height at 100 mm along X, as much less along Y"),
            Parameter("twist_um", "µm", 5.0, "further height at 100 mm between +X and +Y, as much less across"),
            Parameter(
                "middle_depth_mm",
                "mm",
                50.0,
                "depth of the plate's middle surface under the origin of the jig",
                grid=(0.0, 25.0, 50.0, 100.0, 200.0),
            ),
        )

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        place, lean = _bends(motion)
        return Effect(fixed_ball_mm=(place + values[3] * lean) @ values[:3])

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        place, lean = _bends(motion)
        return Effect(fixed_ball_mm=np.column_stack([place + values[3] * lean, lean @ values[:3]]))


def _bends(motion: Motion) -> tuple[Floats, Floats]:
    """Return the ball's shift by bow, saddle and twist: at d = 0, and its change per mm of depth."""
    # Both have shape (3, 3), in [mm/µm] and [1/µm]; a ball in no bore gives zero.
    setup = motion.setup
    if setup is None or setup.plate is None:
        return np.zeros((3, 3)), np.zeros((3, 3))
    x, y, z = setup.fixed_ball_mm - setup.plate.origin_mm
    per_um = MM_PER_UM / REACH_MM**2
    lean = -2.0 * per_um * np.array([[x, x, y], [y, -y, x], [0.0, 0.0, 0.0]])
    place = z * lean
    place[2] = per_um * np.array([x**2 + y**2, x**2 - y**2, 2.0 * x * y])
    return place, lean
