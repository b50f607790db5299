"""Sessions of machines whose laws are not those of any textbook: what is put in, and how it is drawn.

Two robots, sizes as in a shop, one to three causes of the list, often with a bar that wanders, struts that stick or a
jig that was knocked; besides sessions with nothing wrong, or with nothing but a wander or sticking. A wide study has
four robots and up to four causes.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.circumstances import Circumstances
from tests.plant.blind.disturbances import DISTURBANCES, NAME_ON_THE_LIST
from tests.plant.blind.effect import Effect
from tests.plant.blind.hide import Hidden, Hider
from tests.plant.blind.listed import LISTED
from tests.plant.drive_path import Timing
from tests.plant.foreign.laws import other_law
from tests.plant.machine import reference_machine
from tests.plant.mechanisms.balls import CmmScatter, MountingScatter
from tests.plant.mechanisms.bar import RandomBarOffset
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.mechanisms.reversal_forms import StickSlip
from tests.plant.noise import Noise
from tests.plant.plan import Path, table_ii_plan
from tests.plant.session import record
from tests.plant.truth import plain

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from tests.plant.machine import Machine
    from tests.plant.run import Scene

KINDS = (*["clean"] * 8, *["walk"] * 4, *["stick-slip"] * 4, *["single"] * 18, *["pair"] * 16, *["triple"] * 10)
"""Of sixty sessions; more of them begin anew, shuffled by the seed."""
WIDE_KINDS = (*["clean"] * 10, *["single"] * 12, *["pair"] * 12, *["triple"] * 10, *["quadruple"] * 6)
"""Of fifty sessions of a wide study."""
CAUSES = {"single": 1, "pair": 2, "triple": 3, "quadruple": 4}
SIZES: dict[str, tuple[float, float, int]] = {
    "backlash": (2.0, 8.0, 3),
    "screw-cyclic": (1.5, 4.0, 3),
    "gravity": (6.0, 12.0, 3),
    "play": (3.0, 10.0, 2),
    "thermal-struts": (2.0, 6.0, 2),
    "spindle-growth": (2.0, 8.0, 2),
    "bar-drift": (1.0, 4.0, 1),
    "base-compliance": (1.0, 4.0, 1),
    "servo-lag": (2.0, 8.0, 1),
    "reversal-spike": (3.0, 10.0, 1),
    "joint-runout": (15.0, 60.0, 1),
    "bar-cyclic": (0.5, 1.5, 1),
    "ball-form": (0.5, 2.0, 1),
    "jig-bump": (4.0, 20.0, 1),
}
"""By cause: least and largest amplitude in the unit of its effect, even in the logarithm, and how often it is drawn."""
RATE_HZ = 25.0
"""Some 500 to 950 readings a circle: a diagnosis costs less than half a minute of an idle core."""
WALK_UM_ROOT_S, STICK_UM = (0.015, 0.08), (2.0, 6.0)
BESIDE = {"walk": 0.25, "stick-slip": 0.12}
"""Shares of the sessions with causes in which the bar wanders or struts stick, too."""
LEAST_SIZE = 2.0
"""In testable limits, with all amplitudes of the other causes fitted too: nothing is put in that nobody can see."""
DRAWS = 60


def kind_of(seed: int, number: int, *, wide: bool = False) -> str:
    """What is put into a session, from 1 on."""
    kinds = WIDE_KINDS if wide else KINDS
    turn, place = divmod(number - 1, len(kinds))
    return str(np.random.default_rng([seed, turn, 8]).permutation(kinds)[place])


def make(out: FilePath, seed: int, number: int, *, wide: bool = False) -> dict[str, Any]:
    """Write session `out/NNNN`, then its answer beside it; one that has its answer stays as it is."""
    folder = out / f"{number:04d}"
    kept = out / "answers" / f"{folder.name}.json"
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    shutil.rmtree(folder, ignore_errors=True)
    rng = np.random.default_rng([seed, number, 7])
    session_seed, kind = int(rng.integers(2**31)), kind_of(seed, number, wide=wide)
    circumstances = _circumstances(rng, session_seed, *(_one_of_four(rng) if wide else _one_of_two(rng)))
    hidden = _put_in(rng, circumstances, kind)
    truth = record(
        folder,
        seed=session_seed,
        plan=circumstances.plan,
        machine=circumstances.machine,
        mechanisms=[circumstances.kinematics, *(item.mechanism for item in hidden)],
        setup=circumstances.setup,
        noise=circumstances.noise,
        rate_hz=circumstances.rate_hz,
        timing=circumstances.timing,
        angles=circumstances.angles,
    )
    answer = {
        "session": folder.name,
        "seed": session_seed,
        "kind": kind,
        "perturbed": True,
        "effects": [item.answer for item in hidden],
        "raised_bars": False,
        "circumstances": circumstances.told(),
        "truth": truth.as_dict(),
    }
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(answer, default=plain) + "\n", encoding="utf-8")
    return answer


def small_machine() -> Machine:
    """The reference machine at 0.8 of its size, its joints in wider pairs."""
    return _machine("PM-600-like at 0.8", (588.0, 11.0), (316.0, 16.0, 400.0))


def broad_machine() -> Machine:
    """A base of 1.2 times the reference's radius, joints in pairs of 40 degrees, and a short spindle."""
    return _machine("broad base, short spindle", (882.0, 20.0), (420.0, 20.0, 350.0))


def slender_machine() -> Machine:
    """A base of 0.85 times the reference's radius, close pairs, a narrow platform and a long spindle."""
    return _machine("narrow base, long spindle", (625.0, 4.0), (300.0, 8.0, 560.0))


def _machine(name: str, base: tuple[float, float], platform: tuple[float, float, float]) -> Machine:
    """Joints in pairs: radius [mm] and half the angle between the two [deg], and the platform's height over the tip [mm]."""

    def at(radius_mm: float, half_deg: float, z_mm: float, middles_deg: tuple[int, ...]) -> Any:
        rad = np.radians([middle + side * half_deg for middle, side in zip(middles_deg, (1, -1) * 3, strict=True)])
        return np.stack([radius_mm * np.cos(rad), radius_mm * np.sin(rad), np.full(6, z_mm)], axis=1)

    return replace(
        reference_machine(),
        base_joints_mm=at(*base, 0.0, (90, 210, 210, 330, 330, 90)),
        platform_joints_mm=at(platform[0], -platform[1], platform[2], (150, 150, 270, 270, 30, 30)),
        name=name,
    )


def _one_of_two(rng: np.random.Generator) -> tuple[Machine, Path]:
    small = bool(rng.random() < 0.5)
    path = Path(100.0, 2000.0) if small else Path(150.0, float(rng.choice([1500.0, 2500.0])))
    return small_machine() if small else reference_machine(), path


def _one_of_four(rng: np.random.Generator) -> tuple[Machine, Path]:
    machine = (reference_machine, small_machine, broad_machine, slender_machine)[int(rng.integers(4))]()
    return machine, Path(float(rng.choice([100.0, 150.0])), float(rng.choice([1500.0, 2000.0, 2500.0])))


def _circumstances(rng: np.random.Generator, seed: int, machine: Machine, path: Path) -> Circumstances:
    size_mm = float(rng.uniform(0.02, 0.1))
    white_um = float(rng.uniform(0.3, 0.5))
    coloured = Noise(white_um, float(rng.uniform(0.1, 0.3)), float(rng.uniform(0.5, 0.8)))
    return Circumstances(
        machine,
        table_ii_plan(seed, path),
        "table-ii",
        Kinematics(size_mm * rng.standard_normal(6), size_mm * rng.standard_normal((6, 3))),
        (MountingScatter(), CmmScatter(), RandomBarOffset()),
        {},
        coloured if rng.random() < 0.5 else Noise(white_um),
        RATE_HZ,
        Timing(),
        angles=bool(rng.random() < 0.5),
        crc=False,
        currents=False,
        breaks_s={},
    )


def _put_in(rng: np.random.Generator, circumstances: Circumstances, kind: str) -> list[Hidden]:
    if kind == "clean":
        return []
    scene = circumstances.scene()
    if kind in DISTURBING:
        return [_disturbance(rng, scene, kind)]
    causes = _causes(Hider(rng, circumstances), rng, scene, CAUSES[kind])
    return causes + [_disturbance(rng, scene, one) for one, share in BESIDE.items() if rng.random() < share]


def _causes(hider: Hider, rng: np.random.Generator, scene: Scene, count: int) -> list[Hidden]:
    """So many causes of the list, drawn anew until each shows beside the others; then each gets another law."""
    weights = np.array([often for _, _, often in SIZES.values()], dtype=float)
    for _ in range(DRAWS):
        names = [str(name) for name in rng.choice(list(SIZES), count, replace=False, p=weights / weights.sum())]
        effects = [_effect(rng, scene, name) for name in names]
        found = hider.at(effects, [_even(rng, SIZES[name][:2]) for name in names])
        if all(item.answer["size"] >= LEAST_SIZE for item in found):
            return [_off_its_law(rng, item) for item in found]
    raise ArithmeticError(f"no {count} causes show together on this plan")


def _effect(rng: np.random.Generator, scene: Scene, name: str) -> Effect:
    if name != "jig-bump":
        effect: Effect = LISTED[name](rng, scene)
        return effect
    bump: Effect = DISTURBANCES["bumped-jig"](rng, scene)
    return replace(bump, name=NAME_ON_THE_LIST["bumped-jig"])


def _off_its_law(rng: np.random.Generator, item: Hidden) -> Hidden:
    perturbation = other_law(rng, item.effect.name)
    told = None if perturbation is None else {"size": perturbation.size, "forms": list(perturbation.forms)}
    return replace(item, answer={**item.answer, "deviation": told}, perturbation=perturbation)


def _disturbance(rng: np.random.Generator, scene: Scene, kind: str) -> Hidden:
    draw, sizes = DISTURBING[kind]
    effect, scale = draw(rng, scene), _even(rng, sizes)
    told = {
        "name": effect.name,
        "listed": False,
        "largest_amplitude": scale,
        "unit": effect.unit,
        "struts": list(effect.struts),
        "amplitudes": {},
    }
    return Hidden(effect, scale, told)


def _sticking(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    shares, jerks = rng.uniform(0.4, 1.0, 6) * (rng.random(6) < 0.5), int(rng.integers(3, 8))
    shares[int(rng.integers(6))] = 1.0
    return Effect(
        "stick-slip",
        lambda a: StickSlip(tuple((a[0] * shares).tolist()), jerks),
        np.ones(1),
        "µm",
        20.0,
        tuple(int(strut) + 1 for strut in np.flatnonzero(shares)),
        ("strut-speed-sign", "reversal"),
    )


DISTURBING: dict[str, Any] = {
    "walk": (DISTURBANCES["wandering-bar"], WALK_UM_ROOT_S),
    "stick-slip": (_sticking, STICK_UM),
}
"""What is on no list: how it is drawn, and its least and largest size."""


def _even(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(bounds))))
