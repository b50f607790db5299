"""The diagnosis that compares sets of causes: do recordings differ from the model, which physics was left out."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit import SMALLEST_NOISE_MM
from dbbstation.calibration.missing_physics import is_missing_physics
from dbbstation.calibration.noise_level import fine_noise_mm
from dbbstation.calibration.stray_balls import beside
from dbbstation.diagnosis.channel import thinned
from dbbstation.diagnosis.diagnose import FOLDS, locations_of, shifts_between, single_noise_mm, tests_of
from dbbstation.diagnosis.findings import Diagnosis, Unexplained
from dbbstation.diagnosis.sets.explain import SURE, explain
from dbbstation.diagnosis.sets.verdicts import judge
from dbbstation.diagnosis.unexplained_curve import curve_of
from dbbstation.diagnosis.unexplained_model import with_exact_wave
from dbbstation.diagnosis.unnamed import unnamed
from dbbstation.diagnosis.workspace import workspace_error
from dbbstation.inference.held_out import HeldOut, held_out
from dbbstation.inference.square_root import Columns

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.sets.explain import Explained, Settled
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.model_comparison import Member
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource


def diagnose_by_sets(
    machine: Machine,
    observations: Sequence[Observation],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Find what a kinematic calibration leaves out, by the probabilities of sets of causes.

    It proposes no next test and draws no parts of the tests; see docs/decisions/0019.

    Args:
        machine: nominal machine.
        observations: raw runs.
        sources: named candidates, several forms of one cause under one name; those that lack what they need are left out
            by the caller.
        progress: told what is being done.

    Raises:
        CalibrationError: the base model cannot be fitted.
        ModelError: a source needs what the runs or the machine file do not give.
    """
    runs = [thinned(observation) for observation in observations]
    explained = explain(machine, runs, sources, progress)
    settled, before, outliers = explained.settled, explained.before, explained.outliers
    after, members = settled.after, settled.members
    progress("verdicts")
    findings = judge(explained)
    rest = _unexplained(explained, settled.left)
    found = [explained.channel.source_of(m.cause.name, m.variant) for m in members]
    mismatch = is_missing_physics(explained.first) or bool(members) or bool(outliers) or rest.variable is not None
    progress("held-out tests")
    predicted = _held_out(explained, members)
    return Diagnosis(
        mismatch=mismatch,
        misfit=explained.first,
        left=settled.left,
        before=before,
        after=after,
        held_out=predicted,
        outliers=tuple(beside(outlier, after) for outlier in outliers),
        workspace=workspace_error(before, after) if members else None,
        locations=locations_of(before, after, found, explained.first, rest.variable) if mismatch else (),
        sources=findings,
        unexplained=with_exact_wave(rest, after),
        shifts=shifts_between(before, after),
        next_tests=None,
    )


def _unexplained(explained: Explained, left: Misfit) -> Unexplained:
    """What no named cause explains: the unmodelled effect that brings most, where one is there for sure."""
    settled = explained.settled
    posterior, shapes = settled.posterior, settled.unmodelled.shapes
    effects = [m for m in settled.best.members if m.cause.name in shapes]
    sure = posterior.probability(shapes) >= SURE
    if not effects or not sure:
        if not is_missing_physics(left):
            return Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise.")
        rough = rough_formulas(settled)
        text = "Something is left beyond noise, and no variable organises it clearly."
        if rough:
            text = (
                f"What is left is what the formula of {', '.join(rough)} may be off by: the machine follows it roughly."
            )
        return Unexplained(1e3 * left.rms, None, None, 0.0, text)
    member = max(effects, key=lambda m: settled.best.log_factor(m.cause.name))
    shape = shapes[member.cause.name]
    of = unnamed(settled.after, settled.noise_mm, [shape])
    curve = curve_of(of, of.best())
    where = f"strut {shape.strut}" if shape.strut else "no single strut"
    text = f"An unmodelled effect, organised by {shape.name}, {where}."
    rms_um = 1e3 * left.rms if is_missing_physics(left) else curve.unconcealed_um
    gain = settled.best.log_factor(member.cause.name)
    return Unexplained(rms_um, shape.strut, shape.name, gain, text, curve)


def rough_formulas(settled: Settled) -> list[str]:
    """Named causes whose slack the recordings call for: the joint fit, which has none, leaves it."""
    evidence = settled.comparison.log_evidence(settled.best.members)
    found = []
    for member in settled.members:
        firm = [replace(m, slack_scale=0.0) if m is member else m for m in settled.best.members]
        if len(member.variant.slack) and evidence - settled.comparison.log_evidence(firm) > CLEAR:
            found.append(member.cause.name)
    return found


CLEAR = 3.0
"""Log Bayes factor from which on one thing is clearly more probable than another: odds of 20 to 1."""


def _held_out(explained: Explained, members: Sequence[Member]) -> tuple[HeldOut, HeldOut]:
    """Predictions of left-out tests without and with the named causes [mm]."""
    channel, settled = explained.channel, explained.settled
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    single = max(single_noise_mm(channel.observations, noise_mm, fine_noise_mm(settled.after)), SMALLEST_NOISE_MM)
    tests = tests_of(channel.observations)
    groups = [test % min(FOLDS, max(tests) + 1) for test in tests]
    columns = np.concatenate([np.zeros(0, dtype=np.int64), *(m.variant.columns for m in members)])
    sd = np.concatenate([np.zeros(0), *(m.variant.plausible for m in members)])
    base = channel.base
    known = Columns(
        np.concatenate([base.prior, sd]),
        np.concatenate([base.scale, sd]),
        np.concatenate([base.random, np.ones(len(sd), dtype=bool)]),
    )
    blocks = channel.blocks(columns, channel.target(settled.after))
    every = np.arange(len(known.prior))
    without, having = (
        held_out(blocks, groups, known, active, noise_mm, channel.held, single)
        for active in (every[: len(base.prior)], every)
    )
    return without, having
