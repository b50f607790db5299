"""What disturbs a session beside an effect of the list, drawn at random but for its size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.effect import Effect
from tests.plant.blind.unlisted import strut_and_length
from tests.plant.mechanisms.disturbances import (
    WALK_STEP_S,
    BarScale,
    BumpedJig,
    KinkedStrut,
    RingingStrut,
    WanderingBar,
)
from tests.plant.mechanisms.perturbed_forms import GradualBacklash

if TYPE_CHECKING:
    from tests.plant.run import Scene

ONE = np.ones(1)
LEAST_RUNS = 4
"""Runs on either side of a bump."""


def _wandering_bar(rng: np.random.Generator, scene: Scene) -> Effect:
    steps = int(np.ceil(scene.end_s / WALK_STEP_S)) + 2
    walk_um = np.sqrt(WALK_STEP_S) * np.cumsum(rng.standard_normal(steps))
    return Effect(
        "wandering-bar",
        lambda a: WanderingBar(float(a[0]), tuple((a[0] * walk_um).tolist())),
        ONE,
        "µm per root of a second",
        0.3,
        (),
        ("time",),
    )


def _bent_scale(rng: np.random.Generator, scene: Scene) -> Effect:
    del rng, scene
    return Effect("bent-scale", lambda a: BarScale(curved_um=float(a[0])), ONE, "µm", 5.0, (), ("reading",))


def _bumped_jig(rng: np.random.Generator, scene: Scene) -> Effect:
    from_run = int(rng.integers(LEAST_RUNS, len(scene.slots) - LEAST_RUNS))
    direction = rng.standard_normal(3) * np.array([1.0, 1.0, 0.2])
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    return Effect(
        "bumped-jig",
        lambda a: BumpedJig((float(a[0] * x), float(a[0] * y), float(a[0] * z)), from_run),
        ONE,
        "µm",
        15.0,
        (),
        ("time",),
    )


def _kinked_strut(rng: np.random.Generator, scene: Scene) -> Effect:
    strut, at_mm = strut_and_length(rng, scene)
    return Effect(
        "kinked-strut",
        lambda a: KinkedStrut(strut, at_mm, float(a[0])),
        ONE,
        "µm/m",
        1000.0,
        (strut,),
        ("strut-length",),
    )


def _ringing_strut(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    strut = int(rng.integers(6)) + 1
    period_s, decay_s = float(rng.uniform(0.3, 1.5)), float(rng.uniform(0.8, 3.0))
    return Effect(
        "ringing-strut",
        lambda a: RingingStrut(strut, float(a[0]), period_s, decay_s),
        ONE,
        "µm",
        10.0,
        (strut,),
        ("reversal", "strut-speed"),
    )


def _presliding(rng: np.random.Generator, scene: Scene) -> Effect:
    """A gap that friction winds up over a tenth of a millimetre and more before it is crossed."""
    del scene
    transit_um = tuple(np.exp(rng.uniform(np.log(60.0), np.log(300.0), 6)).tolist())
    shares = rng.uniform(0.3, 1.0, 6)
    return Effect(
        "presliding",
        lambda a: GradualBacklash(tuple((a[0] * shares).tolist()), transit_um),
        ONE,
        "µm",
        20.0,
        (),
        ("strut-speed-sign",),
    )


DISTURBANCES: dict[str, Any] = {
    "wandering-bar": _wandering_bar,
    "bent-scale": _bent_scale,
    "bumped-jig": _bumped_jig,
    "kinked-strut": _kinked_strut,
    "ringing-strut": _ringing_strut,
    "presliding": _presliding,
}
"""How each is drawn, by name: a function of a random generator and the scene."""

NAME_ON_THE_LIST = {"bent-scale": "bar-scale", "bumped-jig": "jig-bump", "presliding": "backlash"}
"""By which name of the list a diagnosis may call a disturbance; none for the others, which are on no list."""
