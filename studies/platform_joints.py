"""Identify platform-joint errors of which kinematic parameters conceal 99 %.

A machine is measured, diagnosed, and measured again with proposed tests.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.diagnosis.diagnose import diagnose, usable_sources
from dbbstation.diagnosis.effects import workspace
from dbbstation.inference.levels import Verdict
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Plan, PlannedTest
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.diagnosed import default_candidates
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.findings import Diagnosis, NextTest
    from dbbstation.machine.geometry import Machine

NAME = "platform-joints"
NOISE_MM = 0.0005
SAMPLES = 360
MOST_ROUNDS = 5
"""Times that proposed tests are added."""


@dataclass(frozen=True)
class Round:
    """One look at the machine.

    Attributes:
        tests: so far.
        added: for this look.
        verdict: on platform joints.
        gain: log evidence.
        concealed: share absorbed by kinematic parameters.
        kinematic_um: true workspace error of the kinematic calibration, rms less mean.
        stated_um: the joint model's own, less common shift; None if unknown.
        held_out: in predicted covariance, before and after.
    """

    tests: int
    added: tuple[str, ...]
    verdict: str
    ambiguous_with: tuple[str, ...]
    gain: float
    concealed: float
    kinematic_um: float
    joint_um: float
    stated_um: float | None
    held_out: tuple[float, float]


def platform_joints(
    machine: Machine,
    jig: Plan,
    seed: int,
    joint_error_mm: float,
    progress: Callable[[str], None],
    most_rounds: int = MOST_ROUNDS,
) -> list[Round]:
    """Measure as proposed until platform joints are named.

    Args:
        jig: the fifteen circles of [CAL Table II].
        most_rounds: of added tests.
    """
    rng = np.random.default_rng([seed, 9])
    source = known_sources()[NAME]
    errors = Fitted(source, rng.normal(0.0, joint_error_mm, len(source.parameters(machine))))
    truth = MachineModel(machine, (*random_kinematics(machine, seed), errors))
    plan, added, rounds = jig, list[str](), list[Round]()
    for k in range(most_rounds + 1):
        # The same random numbers again: what was measured before stays as it was, new tests come behind.
        runs = draw_session(truth, plan, np.random.default_rng([seed, 10]), NOISE_MM, SAMPLES)
        usable, _ = usable_sources(machine, runs, sources_named(default_candidates(known_sources())))
        head = f"round {k + 1} of at most {most_rounds + 1}, {len(plan.tests)} tests"
        found = diagnose(machine, runs, usable, _within(head, progress))
        rounds.append(_round(found, truth, len(plan.tests), added))
        stated_um = rounds[-1].stated_um
        useful = stated_um is not None and stated_um < rounds[-1].kinematic_um
        if (rounds[-1].verdict == Verdict.IDENTIFIED and useful) or not found.next_tests:
            break
        plan = replace(plan, tests={**plan.tests, **_planned(plan, found.next_tests, k)})
        added = [test.text for test in found.next_tests]
    return rounds


def _within(head: str, progress: Callable[[str], None]) -> Callable[[str], None]:
    return lambda text: progress(f"{head}: {text}")


def numbers(rounds: Sequence[Round], seed: int, joint_error_mm: float) -> dict[str, Any]:
    """Return all rounds as plain numbers."""
    return {
        "seed": seed,
        "joint_error_um": 1e3 * joint_error_mm,
        "rounds": [
            {
                "tests": one.tests,
                "added": list(one.added),
                "verdict": one.verdict,
                "ambiguous_with": list(one.ambiguous_with),
                "gain": one.gain,
                "concealed": one.concealed,
                "workspace_error_um": {
                    "kinematic": one.kinematic_um,
                    "joint": one.joint_um,
                    "stated": one.stated_um,
                },
                "held_out_normalised": dict(zip(("before", "after"), one.held_out, strict=True)),
            }
            for one in rounds
        ],
    }


def _round(found: Diagnosis, truth: MachineModel, tests: int, added: Sequence[str]) -> Round:
    finding = next(f for f in found.sources if f.name == NAME)
    before, after = found.held_out
    return Round(
        tests=tests,
        added=tuple(added),
        verdict=str(finding.verdict),
        ambiguous_with=finding.ambiguous_with,
        gain=finding.gain or 0.0,
        concealed=finding.concealed or 0.0,
        kinematic_um=_apart_um(found.before.model.of_the_machine(), truth),
        joint_um=_apart_um(found.after.model.of_the_machine(), truth),
        stated_um=None if found.workspace is None else found.workspace.uncertainty_rms_um,
        held_out=(before.normalised, after.normalised),
    )


def _apart_um(model: MachineModel, truth: MachineModel) -> float:
    """Return a model's true workspace error, rms less mean [µm]."""
    motion = Motion(workspace(truth.machine))
    apart = model.actual_poses(motion)[:, :3] - truth.actual_poses(motion)[:, :3]
    apart -= apart.mean(axis=0)
    return 1e3 * float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _planned(plan: Plan, proposed: Sequence[NextTest], round_number: int) -> dict[str, PlannedTest]:
    tests = {}
    for k, test in enumerate(proposed):
        place = tuple(getattr(test, f"{axis}_mm") for axis in "xyz")
        like = min(
            plan.tests.values(), key=lambda known: float(np.linalg.norm(np.subtract(known.ball.centre_mm, place)))
        )
        x, y, z = like.ball.centre_mm
        elevation = test.elevation_deg
        height = z + like.circle.bar_mm * float(np.sin(np.radians(elevation)))
        circle = replace(
            like.circle,
            tilt_deg=(test.a_deg, test.b_deg, 0.0),
            elevation_deg=elevation,
            centre_mm=(x, y, height),
        )
        name = f"next-{round_number + 1}-{k + 1}"
        tests[name] = PlannedTest(name, like.ball, circle, like.directions)
    return tests
