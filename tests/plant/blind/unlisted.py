"""Effects outside the list, drawn at random but for their size, with what a diagnosis could say of where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.effect import Effect
from tests.plant.mechanisms.oddities import (
    BentCover,
    CreepingSpindle,
    CyclingChiller,
    RockingTable,
    SpringyDrive,
    WindingCable,
)
from tests.plant.mechanisms.outsiders import (
    BuildingSway,
    DentedScrew,
    HoseDrag,
    LobedSocket,
    OddGearWobble,
    SoftFloor,
)

if TYPE_CHECKING:
    from tests.plant.run import Scene

ONE = np.ones(1)


def strut_and_length(rng: np.random.Generator, scene: Scene) -> tuple[int, float]:
    from tests.plant.hexapod import strut_lengths  # noqa: PLC0415 - only here

    strut = int(rng.integers(6))
    centres = [slot.path.poses(np.array([slot.path.duration_s / 2])) for slot in scene.slots]
    lengths_mm = np.concatenate([strut_lengths(scene.machine, pose)[:, strut] for pose in centres])
    low, high = np.percentile(lengths_mm, [25.0, 75.0])
    return strut + 1, float(rng.uniform(low, high))


def _odd_gear(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    strut, ratio, phase_deg = int(rng.integers(6)) + 1, float(rng.uniform(0.25, 0.45)), float(rng.uniform(0, 360))
    return Effect(
        "odd-gear-wobble",
        lambda a: OddGearWobble(strut, float(a[0]), ratio, phase_deg),
        ONE,
        "µm",
        20.0,
        (strut,),
        ("strut-length",),
    )


def _soft_floor(rng: np.random.Generator, scene: Scene) -> Effect:
    del rng, scene
    return Effect(
        "soft-floor", lambda a: SoftFloor(0.01 * float(a[0])), ONE, "0.01 µrad/mm", 50.0, (), ("position", "angle")
    )


def _lobed_socket(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    lobes, phase_deg = int(rng.choice([6, 7, 8])), float(rng.uniform(0, 360))
    return Effect("lobed-socket", lambda a: LobedSocket(float(a[0]), lobes, phase_deg), ONE, "µm", 10.0, (), ("angle",))


def _hose_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    angle_rad = float(rng.uniform(0, 2 * np.pi))
    anchor = (900.0 * float(np.cos(angle_rad)), 900.0 * float(np.sin(angle_rad)), -200.0)
    return Effect(
        "hose-drag",
        lambda a: HoseDrag(float(a[0]), anchor_mm=anchor),
        ONE,
        "N/mm",
        5.0,
        (),
        ("position", "strut-force"),
    )


def _dented_screw(rng: np.random.Generator, scene: Scene) -> Effect:
    (strut, at_mm), width_mm = strut_and_length(rng, scene), float(rng.uniform(4.0, 12.0))
    return Effect(
        "dented-screw",
        lambda a: DentedScrew(strut, at_mm, width_mm, float(a[0])),
        ONE,
        "µm",
        20.0,
        (strut,),
        ("strut-length",),
    )


def _building_sway(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    period_s, towards_deg = float(rng.uniform(8.0, 40.0)), float(rng.uniform(0, 180))
    return Effect(
        "building-sway",
        lambda a: BuildingSway(float(a[0]), period_s, towards_deg),
        ONE,
        "µm",
        15.0,
        (),
        ("time",),
    )


def _bent_cover(rng: np.random.Generator, scene: Scene) -> Effect:
    (strut, at_mm), width_mm = strut_and_length(rng, scene), float(rng.uniform(15.0, 40.0))
    return Effect(
        "bent-cover",
        lambda a: BentCover(strut, at_mm, width_mm, float(a[0])),
        ONE,
        "µm",
        20.0,
        (strut,),
        ("strut-length",),
    )


def _springy_drive(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    strut = int(rng.integers(6)) + 1
    return Effect(
        "springy-drive",
        lambda a: SpringyDrive(strut, float(a[0])),
        ONE,
        "µm s²/m",
        2.0e4,
        (strut,),
        ("strut-acceleration",),
    )


def _creeping_spindle(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    share, phase_deg = float(rng.uniform(2.3, 4.7)), float(rng.uniform(0, 360))
    return Effect(
        "creeping-spindle",
        lambda a: CreepingSpindle(float(a[0]), share, phase_deg),
        ONE,
        "µm",
        15.0,
        (),
        ("angle",),
    )


def _rocking_table(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    across_deg, line_mm = float(rng.uniform(0, 180)), float(rng.uniform(-60, 60))
    tip = rng.standard_normal(3) / 2.0
    return Effect(
        "rocking-table",
        lambda a: RockingTable((float(a[0] * tip[0]), float(a[0] * tip[1]), float(a[0] * tip[2])), across_deg, line_mm),
        ONE,
        "µm",
        20.0,
        (),
        ("position",),
    )


def _cycling_chiller(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    strut, period_s = int(rng.integers(6)) + 1, float(rng.uniform(15.0, 60.0))
    return Effect(
        "cycling-chiller",
        lambda a: CyclingChiller(strut, float(a[0]), period_s),
        ONE,
        "µm",
        15.0,
        (strut,),
        ("time",),
    )


def _winding_cable(rng: np.random.Generator, scene: Scene) -> Effect:
    del rng, scene
    return Effect("winding-cable", lambda a: WindingCable(float(a[0])), ONE, "µm", 10.0, (), ("angle", "time"))


UNLISTED: dict[str, Any] = {
    "odd-gear-wobble": _odd_gear,
    "soft-floor": _soft_floor,
    "lobed-socket": _lobed_socket,
    "hose-drag": _hose_drag,
    "dented-screw": _dented_screw,
    "building-sway": _building_sway,
    "bent-cover": _bent_cover,
    "springy-drive": _springy_drive,
    "creeping-spindle": _creeping_spindle,
    "rocking-table": _rocking_table,
    "cycling-chiller": _cycling_chiller,
    "winding-cable": _winding_cable,
}
"""How each is drawn, by name: a function of a random generator and the scene."""
