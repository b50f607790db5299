"""Curves of causes and gains of tests, for the figure of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.circle import Direction


@dataclass(frozen=True, eq=False)
class Trace:
    """One run by rising angle, shape (s,) each.

    Attributes:
        theta_deg: from +X towards +Y.
    """

    direction: Direction
    theta_deg: Floats
    measured_um: Floats
    before_um: Floats
    after_um: Floats


@dataclass(frozen=True)
class GainOfTest:
    """One test, all its runs together."""

    name: str
    residual_um: tuple[float, float]
    circularity_um: tuple[float, float]
    traces: tuple[Trace, ...]

    @property
    def gain_um(self) -> float:
        """Return the reduction [µm]."""
        return self.residual_um[0] - self.residual_um[1]


@dataclass(frozen=True, eq=False)
class Branch:
    """One curve over pieces, shape (b,) each.

    Attributes:
        sense: `lengthening` or `shortening`, or empty.
        model_um: mean error by the source.
        before_um: strut error that explains the base residual; NaN if hardly measured.
        after_um: the model's plus the joint residual's; NaN if hardly measured.
    """

    sense: str
    variable: Floats
    model_um: Floats
    before_um: Floats
    after_um: Floats
    sigma_um: Floats


@dataclass(frozen=True)
class SourceCurves:
    """One source.

    Attributes:
        source: empty for the unmodelled residual.
        fine: may change between pieces, as a wave.
        reading: if no strut moves.
    """

    source: str
    variable: str
    unit: str
    fine: bool
    struts: tuple[tuple[Branch, ...], ...]
    reading: tuple[Branch, ...]
