"""Sound sessions of the plant, on usual and on drifting days."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dbbstation.files.formats.model import read_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.recordings.judged import circles_of_plan, run_of
from dbbstation.files.recordings.session import read_session
from dbbstation.model.identified import IdentifiedModel
from dbbstation.quality.finding import Finding, Name
from dbbstation.quality.judge import Judgement, SessionRuns
from dbbstation.quality.knowledge import Run, Seen, seen
from dbbstation.trace.recording import Recording
from tests.cli.conftest import call
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.mechanisms.thermal import ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Warming
from tests.plant.noise import Noise
from tests.plant.plan import Plan, subset, table_ii_plan
from tests.plant.session import Reprogram, record
from tests.quality.spoilers import longer

NOISE = Noise(white_um=0.4, correlated_um=0.4, correlation=0.7)
"""Noise of a reading: coloured, as the bar of the recordings made elsewhere has it."""

REPEATED = ("a", "f", "h", "k", "n")


TESTS = "abdfhjkn"
"""Tests of the sessions that are spoilt: three heights, tilted and level."""


@dataclass(frozen=True)
class Sound:
    """A session with nothing wrong but what every machine has, analysed once."""

    runs: list[Seen]

    def judged(self) -> list[Judgement]:
        session = SessionRuns(self.runs)
        return [session.judge(one) for one in self.runs]

    def with_spoilt(self, run: int, recording: Recording) -> Judgement:
        one = seen(replace(self.runs[run].run, recording=recording))
        return SessionRuns([*self.runs[:run], one, *self.runs[run + 1 :]]).judge(one)


def run(whole: Sound, name: str) -> Seen:
    """The run of a session that has this label, as `a ccw 1`."""
    return next(one for one in whole.runs if one.run.label == name)


def spoilt(one: Seen, spoiler: Callable[..., Recording], *sizes: object) -> Seen:
    return seen(replace(one.run, recording=spoiler(one.run.recording, one.run.circle, *sizes)))


def judged(before: Sequence[Seen], one: Seen) -> Judgement:
    return SessionRuns([*before, one]).judge(one)


def sound(
    folder: Path,
    seed: int,
    tests: str = "abcdefghijklmno",
    rate_hz: float = 50.0,
    also: Sequence[Mechanism] = (),
    noise: Noise = NOISE,
    reprogram: Reprogram | None = None,
    planned: Plan | None = None,
) -> Sound:
    """Kinematic errors, gravity, backlash and lag of a machine of its own, usual scatter of balls and bar, noise."""
    rng = np.random.default_rng([seed, 35])
    plan = planned or subset(table_ii_plan(seed), list(tests))
    plan = replace(plan, repeat_at_end=tuple(name for name in REPEATED if name in tests))
    mechanisms = [
        RandomKinematics(),
        Gravity(),
        Backlash(gap_um=tuple(rng.uniform(0.0, 3.0, 6))),
        ServoLag(tuple(rng.uniform(2.0, 3.0, 6))),
    ]
    mechanisms += also
    record(folder, seed=seed, plan=plan, mechanisms=mechanisms, noise=noise, rate_hz=rate_hz, reprogram=reprogram)
    return read(folder)


def read(folder: Path, model: IdentifiedModel | None = None) -> Sound:
    session = read_session(folder)
    wanted = [(run, session.load(run).recording) for run in session.runs]
    planned = () if model is None else circles_of_plan(session, model)
    return Sound([seen(run_of(session, run, recording, model, planned)) for run, recording in wanted])


def calibrated(folder: Path, seed: int) -> Sound:
    sound(folder / "spoilt", seed, TESTS)
    return read(folder / "spoilt", calibration(folder / "spoilt", folder / "model.yaml"))


def calibration(session: Path, model: Path) -> IdentifiedModel:
    outcome = call("calibrate", session, "--out", model)
    assert outcome.code == 0, outcome.err
    return read_model(model, every_source(()))


def finding_of(judgement: Judgement, name: Name) -> Finding | None:
    return next((finding for finding in judgement.findings if finding.name is name), None)


DRIFTS_UM_MIN, WARMINGS_K_H = (0.0, 1.0), (0.0, 1.0)
"""Bar's drift and warming of struts and frame, from and to, that good circles have [µm/min, K/h]."""


def drifting_session(folder: Path, seed: int, *, with_model: bool = False) -> Sound:
    """A good session on a day of its own: drift, warming, and noise that is white or remembers.

    With a model circles are expected where the session's own calibration puts them; the bar's drift is none of it.
    """
    rng = np.random.default_rng([seed, 134])
    rise_k, slow_s = 100.0 * rng.uniform(*WARMINGS_K_H), 360e3
    warming = Warming(rise_k=rise_k, time_constant_s=slow_s)
    white_um, correlated_um = float(rng.uniform(0.1, 0.6)), float(rng.choice([0.0, 0.4]))
    noise = Noise(white_um=white_um, correlated_um=correlated_um, correlation=float(rng.uniform(0.5, 0.9)))
    also = (ThermalStruts(warming=warming), ThermalFrame(warming=warming))
    whole = sound(folder, seed, also=also, noise=noise)
    um_s = rng.uniform(*DRIFTS_UM_MIN) / 60.0
    if with_model:
        whole = read(folder, calibration(folder, folder.with_suffix(".yaml")))
    return Sound([seen(replace(one.run, recording=_warmed(one.run, um_s))) for one in whole.runs])


def _warmed(run: Run, um_s: float) -> Recording:
    assert run.started_s is not None
    return longer(run.recording, um_s * (run.started_s + run.recording.t_s))
