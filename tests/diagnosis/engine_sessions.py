"""Sessions of the independent plant that a diagnosis must explain, each with the hypothesis that is true of it.

`python -m tests.diagnosis.engine_sessions OUT` writes all of them, and beside them `answers.json`.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.disturbances import BarScale, BumpedJig, KinkedStrut, RingingStrut, WanderingBar
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.thermal import ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Warming
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record
from tests.plant.truth import plain

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.truth import Truth

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
RATE_HZ = 25.0
TESTS = "abcdefghijklmno"
REFERENCE_COMPLIANCE_MM_N = 9.68e-6
BASE_RADIUS_MM = 735.0
EXPANSION_PER_K = 11.5e-6

ONE_STAGE = Warming(rise_k=3.0, time_constant_s=3163.0)
"""Its time constant lies between the points of a grid that doubles from step to step."""
TWO_STAGES = Warming(rise_k=3.0, time_constant_s=2400.0, second_time_constant_s=600.0)
"""Struts that are heated through another body, so that no single exponential fits."""
COLOURED = Noise(white_um=0.3, correlated_um=0.24, correlation=0.6)
"""0.384 µm in total, and as loud at low frequencies as 0.566 µm of white noise."""


def screw_lead_and_gravity(folder: FilePath) -> Truth:
    """Leads off by up to 40 µm/m either way, and half the reference compliance under the platform's weight.

    With the same 40 µm/m on all screws, on one, or on two the causes are told apart more easily.
    """
    errors_um_m = (40.0, -20.0, 30.0, -40.0, 10.0, -30.0)
    return _recorded(folder, 1501, ScrewLead(errors_um_m), Gravity(0.5 * REFERENCE_COMPLIANCE_MM_N))


def gravity_backlash_and_screw_cyclic(folder: FilePath) -> Truth:
    """Three causes at once, each of them many standard deviations out."""
    return _recorded(folder, 1502, Gravity(REFERENCE_COMPLIANCE_MM_N), Backlash(), ScrewCyclic())


def warm_up_of_unknown_time_constant(folder: FilePath) -> Truth:
    return _recorded(folder, 1503, ThermalStruts(ONE_STAGE))


def warm_up_in_two_stages(folder: FilePath) -> Truth:
    return _recorded(folder, 1504, ThermalStruts(TWO_STAGES))


def warm_up_in_two_stages_and_warm_frame(folder: FilePath, outwards_um: float = 6.0) -> Truth:
    """The same struts on a frame that warms more slowly, until its joints have moved `outwards_um` away from its centre."""
    rise_k = outwards_um / (1e3 * BASE_RADIUS_MM * EXPANSION_PER_K)
    return _recorded(folder, 1504, ThermalStruts(TWO_STAGES), ThermalFrame(Warming(rise_k, time_constant_s=5400.0)))


def screw_wave_under_coloured_noise(folder: FilePath) -> Truth:
    """Screws that run out of true by several times the noise; the answer says how loud the noise is."""
    amplitudes_um = (4.0, 6.0, 5.0, 7.0, 3.0, 8.0)
    return _recorded(folder, 1506, ScrewCyclic(amplitudes_um), noise=COLOURED)


def bar_that_wanders(folder: FilePath) -> Truth:
    """A bar whose zero takes a random walk: no catalogue has it, and any curve over time explains a little more of it."""
    return _recorded(folder, 1507, WanderingBar())


def strut_with_a_kink(folder: FilePath) -> Truth:
    """One strut whose scale changes at one length: no smooth curve, wave or bump is it."""
    return _recorded(folder, 1508, KinkedStrut())


def curved_scale_of_the_bar(folder: FilePath) -> Truth:
    """A bar whose scale is bent, read over a tenth of a millimetre either way."""
    return _recorded(folder, 1509, BarScale())


def jig_bumped_once(folder: FilePath, from_run: int = 14) -> Truth:
    """All balls stand 7 µm elsewhere from the eighth test on."""
    return _recorded(folder, 1510, BumpedJig(from_run=from_run))


def strut_that_rings(folder: FilePath) -> Truth:
    return _recorded(folder, 1511, RingingStrut())


RECIPES: dict[str, Callable[[FilePath], Truth]] = {
    recipe.__name__.replace("_", "-"): recipe
    for recipe in (
        screw_lead_and_gravity,
        gravity_backlash_and_screw_cyclic,
        warm_up_of_unknown_time_constant,
        warm_up_in_two_stages,
        warm_up_in_two_stages_and_warm_frame,
        screw_wave_under_coloured_noise,
        bar_that_wanders,
        strut_with_a_kink,
        curved_scale_of_the_bar,
        jig_bumped_once,
        strut_that_rings,
    )
}
"""By the name of the folder that the module writes."""


def answer(truth: Truth) -> dict[str, Any]:
    """What is hidden in a session, by name, and the truth about everything in it."""
    set_up = {"kinematics", "mounting", "ball-coordinate", "bar-offset"}
    return {
        "effects": [item.name for item in truth.mechanisms if item.name not in set_up],
        "noise_total_um": truth.noise.total_um,
        "noise_slow_um": truth.noise.slow_um,
        "truth": truth.as_dict(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.diagnosis.engine_sessions", description=__doc__)
    parser.add_argument(
        "out", type=FilePath, help="folder for the sessions and answers.json; must not exist or be empty"
    )
    out: FilePath = parser.parse_args().out
    if out.exists() and any(out.iterdir()):
        sys.exit(f"{out} is not empty: give a new folder")
    answers = {name: answer(recipe(out / name)) for name, recipe in RECIPES.items()}
    (out / "answers.json").write_text(json.dumps(answers, indent=1, default=plain) + "\n", encoding="utf-8")


def _recorded(folder: FilePath, seed: int, *mechanisms: Mechanism, noise: Noise | None = None) -> Truth:
    plan = subset(table_ii_plan(seed), TESTS)
    return record(folder, seed=seed, plan=plan, mechanisms=[KINEMATICS, *mechanisms], rate_hz=RATE_HZ, noise=noise)


if __name__ == "__main__":
    main()
