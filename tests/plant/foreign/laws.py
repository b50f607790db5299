"""Which other law each cause follows, farther from the textbook's than `blind.perturb` takes it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.perturb import Perturbation, drawn_perturbation
from tests.plant.mechanisms.perturbed import ByLoad, FromStrutToStrut
from tests.plant.mechanisms.perturbed_forms import GradualBacklash, HarmonicScrewCyclic
from tests.plant.mechanisms.reversal_forms import SoftBacklash, SoftPlay
from tests.plant.mechanisms.warming import Warming

if TYPE_CHECKING:
    from collections.abc import Callable


def other_law(rng: np.random.Generator, name: str) -> Perturbation | None:
    """The law of one session; None where the textbook's holds."""
    draw = LAWS.get(name)
    return drawn_perturbation(rng, name) if draw is None else draw(rng)


def _six(values: Any) -> Any:
    return tuple(float(value) for value in values)


def _even(rng: np.random.Generator, low: float, high: float, count: int = 6) -> Any:
    return _six(np.exp(rng.uniform(np.log(low), np.log(high), count)))


def _backlash(rng: np.random.Generator) -> Perturbation | None:
    """A third each: hard edges, wound up over tens of micrometres before it slides, edges without an end."""
    form = str(rng.choice(["hard", "wind-up", "soft"]))
    travel_um = _even(rng, 20.0, 150.0) if form == "wind-up" else _even(rng, 3.0, 30.0)

    def apply(law: Any) -> Any:
        kind: Any = GradualBacklash if form == "wind-up" else SoftBacklash
        return kind(law.gap_um, travel_um)

    return None if form == "hard" else Perturbation(float(np.mean(travel_um)), (form,), apply)


def _play(rng: np.random.Generator) -> Perturbation:
    """The strut crosses its gap over some hundred newtons."""
    width_n = float(rng.uniform(50.0, 400.0))
    return Perturbation(width_n, ("soft",), lambda law: SoftPlay(law.gap_um, width_n))  # type: ignore[attr-defined]


def _cyclic(rng: np.random.Generator) -> Perturbation:
    share = float(rng.uniform(0.2, 0.5))
    harmonic, phase_deg = _six(share * rng.uniform(0.7, 1.0, 6)), _six(rng.uniform(0, 360, 6))

    def apply(law: Any) -> Any:
        return HarmonicScrewCyclic(law.amplitude_um, law.phase_deg, harmonic, phase_deg)

    return Perturbation(share, ("second harmonic",), apply)


def _gravity(rng: np.random.Generator) -> Perturbation:
    """Compliance falls by a tenth to four tenths with the load, and differs by two hundredths from strut to strut."""
    size, by_strut = float(rng.uniform(0.1, 0.4)), _six(0.02 * rng.standard_normal(6))
    return Perturbation(size, ("stiffening",), lambda law: ByLoad(FromStrutToStrut(law, by_strut), size))


def _two_stages(rng: np.random.Generator) -> Perturbation:
    first_s, idle = float(np.exp(rng.uniform(np.log(900.0), np.log(4000.0)))), float(rng.uniform(0.3, 1.0))
    share = float(rng.uniform(0.3, 0.9))

    def apply(law: Any) -> Any:
        rise_k = law.warming.rise_k or law.warming.start_k
        return replace(law, warming=Warming(rise_k, first_s, share * first_s, idle))

    return Perturbation(share, ("two stages",), apply)


LAWS: dict[str, Callable[[np.random.Generator], Perturbation | None]] = {
    "backlash": _backlash,
    "play": _play,
    "screw-cyclic": _cyclic,
    "gravity": _gravity,
    "thermal-struts": _two_stages,
    "spindle-growth": _two_stages,
    "bar-drift": _two_stages,
}
"""All others are off their laws as `blind.perturb` draws it."""
