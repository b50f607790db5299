"""How roughly a hidden mechanism follows its law: drawn per session, as far as real machines are known to deviate."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.mechanisms.perturbed import AcrossPlate, AlongStrut, ByDirection, ByLoad, FromStrutToStrut
from tests.plant.mechanisms.perturbed_forms import (
    BowedScrewLead,
    GradualBacklash,
    HarmonicBarCyclic,
    HarmonicScrewCyclic,
    UnevenJointFriction,
)
from tests.plant.mechanisms.warming import SeveralBodies, Warming, stretched

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.mechanisms.backlash import Backlash
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.mechanisms.joints import JointFriction
    from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
    from tests.plant.mechanisms.set_up import BallForm, BarCyclic

CLOSE = (0.01, 0.04)
"""Elastic struts, ground screws, turned crosses: what parts of one make differ by, some hundredths."""
FAIR = (0.03, 0.1)
"""Frames, thin rods and plates: their textbook formulas leave out clamping, ribs and gradients."""
LOOSE = (0.1, 0.3)
"""Friction, play, heat: laws with one or two constants for what depends on lubricant, wear and surroundings."""


@dataclass(frozen=True)
class Perturbation:
    """A deviation from a law, decided but for the size of the effect: its relative size and the forms it takes."""

    size: float
    forms: tuple[str, ...]
    apply: Callable[[Mechanism], Mechanism]


def drawn_perturbation(rng: np.random.Generator, name: str) -> Perturbation | None:
    """A deviation for the effect of that name; None where the effect is a place or a number that cannot deviate."""
    if name not in DEVIATIONS:
        return None
    (low, high), draw = DEVIATIONS[name]
    size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    forms, apply = draw(rng, size)
    return Perturbation(size, forms, apply)


_Drawn = tuple[tuple[str, ...], "Callable[[Mechanism], Mechanism]"]


def _six(values: Any) -> Any:
    return tuple(float(value) for value in values)


def _strut_by_strut(rng: np.random.Generator, size: float) -> Callable[[Mechanism], Mechanism]:
    deviation = _six(size * rng.standard_normal(6))
    return lambda law: FromStrutToStrut(law, deviation)


def _along(rng: np.random.Generator, size: float) -> Callable[[Mechanism], Mechanism]:
    """Waves from a few leads of the screw to the whole travel."""
    wavelength_mm, phase_deg = _six(np.exp(rng.uniform(np.log(80.0), np.log(500.0), 6))), _six(rng.uniform(0, 360, 6))
    return lambda law: AlongStrut(law, size, wavelength_mm, phase_deg)


def _by_direction(rng: np.random.Generator, size: float) -> Callable[[Mechanism], Mechanism]:
    deviation = _six(size * rng.uniform(-1.0, 1.0, 6))
    return lambda law: ByDirection(law, deviation)


def _elastic(rng: np.random.Generator, size: float) -> _Drawn:
    by_strut, load = _strut_by_strut(rng, size), size * float(rng.uniform(0.0, 1.0))
    return ("strut", "load"), lambda law: ByLoad(by_strut(law), load)


def _rods(rng: np.random.Generator, size: float) -> _Drawn:
    return ("strut",), _strut_by_strut(rng, size)


def _backlash(rng: np.random.Generator, size: float) -> _Drawn:
    """Wider in worn stretches; the transit takes up to some tens of micrometres."""
    along, transit_um = _along(rng, size), _six(np.exp(rng.uniform(np.log(5.0), np.log(60.0), 6)))

    def apply(law: Mechanism) -> Mechanism:
        play: Backlash = law  # type: ignore[assignment]
        return along(GradualBacklash(play.gap_um, transit_um))

    return ("length", "transit"), apply


def _worn(rng: np.random.Generator, size: float) -> _Drawn:
    return ("length",), _along(rng, size)


def _turning(rng: np.random.Generator, size: float) -> _Drawn:
    along, direction = _along(rng, size), _by_direction(rng, size)
    return ("length", "direction"), lambda law: direction(along(law))


def _lag(rng: np.random.Generator, size: float) -> _Drawn:
    return ("direction",), _by_direction(rng, size)


def _lead(rng: np.random.Generator, size: float) -> _Drawn:
    bow = _six(size * rng.standard_normal(6))

    def apply(law: Mechanism) -> Mechanism:
        screw: ScrewLead = law  # type: ignore[assignment]
        return BowedScrewLead(screw.error_um_m, screw.zero_mm, bow)

    return ("bow",), apply


def _cyclic(rng: np.random.Generator, size: float) -> _Drawn:
    """A second harmonic, and an amplitude that varies slowly along the screw."""
    along, harmonic, phase_deg = (
        _along(rng, size),
        _six(size * rng.uniform(0.3, 1.0, 6)),
        _six(rng.uniform(0, 360, 6)),
    )

    def apply(law: Mechanism) -> Mechanism:
        screw: ScrewCyclic = law  # type: ignore[assignment]
        return along(HarmonicScrewCyclic(screw.amplitude_um, screw.phase_deg, harmonic, phase_deg))

    return ("harmonic", "length"), apply


def _joint_friction(rng: np.random.Generator, size: float) -> _Drawn:
    period_deg, phase_deg = float(rng.uniform(5.0, 30.0)), float(rng.uniform(0, 360))
    asymmetry = size * float(rng.uniform(-1.0, 1.0))

    def apply(law: Mechanism) -> Mechanism:
        joint: JointFriction = law  # type: ignore[assignment]
        known = {key.name: getattr(joint, key.name) for key in fields(joint)}
        return UnevenJointFriction(
            **known, deviation=size, period_deg=period_deg, phase_deg=phase_deg, asymmetry=asymmetry
        )

    return ("angle", "direction"), apply


def _warming(rng: np.random.Generator, size: float) -> _Drawn:
    """A share of the rise comes from another body, much faster or slower; or the time constants are spread.

    With time constants spread log-normally by s the rise begins `exp(s²/2)` times as fast as that of one body: by
    `1 + size` for the spread taken here.
    """
    another = float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(np.log(3.0), np.log(10.0))))
    form = str(rng.choice(["another body", "stretched"]))
    bodies: tuple[tuple[float, float], ...] = ((1.0 - size, 1.0), (size, another))
    if form == "stretched":
        bodies = stretched(float(np.sqrt(2.0 * np.log1p(size))))

    def apply(law: Mechanism) -> Mechanism:
        warming = law.warming  # type: ignore[attr-defined]
        known = {key.name: getattr(warming, key.name) for key in fields(Warming)}
        return replace(law, warming=SeveralBodies(**known, bodies=bodies))  # type: ignore[type-var]

    return (form,), apply


def _plate(rng: np.random.Generator, size: float) -> _Drawn:
    towards_deg = float(rng.uniform(0, 360))
    return ("place",), lambda law: AcrossPlate(law, size, towards_deg)


def _bar_cyclic(rng: np.random.Generator, size: float) -> _Drawn:
    phase_deg = float(rng.uniform(0, 360))

    def apply(law: Mechanism) -> Mechanism:
        bar: BarCyclic = law  # type: ignore[assignment]
        return HarmonicBarCyclic(bar.amplitude_um, bar.period_um, bar.phase_deg, size, phase_deg)

    return ("harmonic",), apply


def _ball_form(rng: np.random.Generator, size: float) -> _Drawn:
    """Besides the few waves per turn of the law, one with more."""
    count, phase_deg = int(rng.choice([6, 7, 8])), float(rng.uniform(0, 360))

    def apply(law: Mechanism) -> Mechanism:
        ball: BallForm = law  # type: ignore[assignment]
        largest_um = max(abs(amplitude_um) for _, amplitude_um, _ in ball.waves)
        return replace(ball, waves=(*ball.waves, (count, size * largest_um, phase_deg)))

    return ("harmonic",), apply


DEVIATIONS: dict[str, tuple[tuple[float, float], Callable[[np.random.Generator, float], _Drawn]]] = {
    "gravity": (CLOSE, _elastic),
    "screw-lead": (CLOSE, _lead),
    "base-compliance": (FAIR, _elastic),
    "strut-bending": (FAIR, _rods),
    "joint-runout": (CLOSE, _worn),
    "jig-thermal": (FAIR, _plate),
    "jig-distortion": (FAIR, _plate),
    "backlash": (LOOSE, _backlash),
    "play": (LOOSE, _worn),
    "reversal-spike": (LOOSE, _turning),
    "servo-lag": (LOOSE, _lag),
    "screw-cyclic": (LOOSE, _cyclic),
    "joint-friction": (LOOSE, _joint_friction),
    "thermal-struts": (LOOSE, _warming),
    "thermal-frame": (LOOSE, _warming),
    "spindle-growth": (LOOSE, _warming),
    "bar-drift": (LOOSE, _warming),
    "bar-cyclic": (LOOSE, _bar_cyclic),
    "ball-form": (LOOSE, _ball_form),
}
"""Range of the deviation's size relative to the effect, drawn evenly in the logarithm, and the forms that it takes.

Not in here: offsets, coordinates, delays and weights, which are what they are.
"""
