"""Makes the recorded sessions `logged`, `begun` and `virtual` of `fixtures`, and `fixtures/models`, anew: `python -m tests.files.make_fixtures`.

`small` and `under-spindle` are sessions without a seal, as people write them by hand; their recordings stay. The recordings of `small` and `logged` come from
the independent virtual machine of tests/plant, those of `under-spindle` from that of `emulate`; the numbers of the model are made up.
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import Counts, Note, ReadBy, SessionDetails, SetUpReadings
from dbbstation.files.provenance import Provenance
from dbbstation.files.recordings.amending import amend
from dbbstation.files.recordings.new_session import FinishedRun, write_session
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.machine.geometry import ControlCorrection
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import BEGUN, record

FIXTURES = Path(__file__).parents[2] / "fixtures"
PROGRAM = (
    b"(test a cw, 1 um of rounding in the centre)\nG21 G90 G17 G94\nG1 X151.5 Y-0.04 Z-1149.99 A0 B0 C0 F1000\nM2\n"
)


def make_session(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        recorded = Path(scratch) / "recorded"
        record(
            recorded,
            seed=7,
            plan=subset(table_ii_plan(7), "agl"),
            mechanisms=[RandomKinematics()],
            rate_hz=5.0,
            crc=True,
        )
        source = read_session(recorded)
        when = BEGUN - timedelta(minutes=20)
        bar = Bar("DBB-0042", 150.0003, 0.0005, when, 20.3, 10.6, 10.0, 150.0005, 0.3, "ZB-150-17")
        details = SessionDetails(
            serial_number="PM600-0007",
            operator="first shift",
            ambient_temp_c=20.4,
            bar=bar,
            bar_waiver="an example: the bar was on its calibrator",
        )
        writer = SessionWriter.create(
            folder, source.machine, read_inline_plan(recorded / "plan.yaml"), details, lambda: BEGUN
        )
        runs = [source.runs[0], source.runs[1], *source.runs[1:]]
        for index, run in enumerate(runs):
            bumped = index == 1
            extra = {}
            if bumped:
                x, y, z = source.circle(run).centre_mm
                extra = {
                    "program": writer.add_program("a-cw.ngc", PROGRAM, model_sha256="c0" * 32),
                    "centre_mm": (round(x, 3), round(y, 3), round(z, 3)),
                }
            samples = source.load(run).recording
            names = ("t_s", "length_mm", "bar_temp_c", "status")
            started = BEGUN + timedelta(minutes=3 * index)
            journal = writer.start_run(run.test, run.direction, names, started=started, mounting=run.mounting, **extra)
            with journal:
                for t_s, length_mm in zip(samples.t_s, samples.length_mm, strict=True):
                    journal.append((t_s, length_mm, 20.3, "ok"))
                entry = writer.finish_run(journal, Counts(journal.samples, int(bumped), {}))
            writer.judge(entry, accepted=not bumped, reason="operator" if bumped else "")
        writer.note(Note(BEGUN + timedelta(minutes=14), "the gate was opened", 20.1))
        with writer.start_run("l", Direction.CW, names, started=started, mounting=3) as journal:
            journal.append((0.0, 151.5, 20.3, "ok"))
    writer.close()
    renamed = folder / "renamed.yaml"
    text = (folder / "machine.yaml").read_text(encoding="utf-8")
    renamed.write_text(text.replace("name: ", "name: north hall, ", 1), encoding="utf-8")
    amend(folder, "the machine has a name of its own", made=BEGUN + timedelta(hours=1), machine=renamed)
    for left in (".lock", renamed.name):
        (folder / left).unlink()


def make_virtual_session(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        recorded = Path(scratch) / "recorded"
        record(recorded, seed=7, plan=subset(table_ii_plan(7), "a"), mechanisms=[RandomKinematics()], rate_hz=5.0)
        source = read_session(recorded)
        by = ReadBy("streaming-encoder", "crc", "virtual machine", virtual=True)
        details = SessionDetails(serial_number="PM600-0007", operator="first shift", ambient_temp_c=20.4, instrument=by)
        plan = read_inline_plan(recorded / "plan.yaml")
        with SessionWriter.create(folder, source.machine, plan, details, lambda: BEGUN) as writer:
            for run in source.runs:
                samples = source.load(run).recording
                names = ("t_s", "length_mm", "status")
                with writer.start_run(
                    run.test, run.direction, names, started=run.started, mounting=run.mounting, instrument=by
                ) as journal:
                    for t_s, length_mm in zip(samples.t_s, samples.length_mm, strict=True):
                        journal.append((t_s, length_mm, "ok"))
                    entry = writer.finish_run(journal, Counts(journal.samples, 0, {}))
                writer.judge(entry, accepted=True)
    (folder / ".lock").unlink()


def make_conventional_session(folder: Path) -> None:
    """Two tests about balls put up under the spindle, set up by hand and read with a micrometer to 1 µm."""
    machine = read_machine(FIXTURES / "machines" / "reference.yaml")
    whole = read_inline_plan(FIXTURES.parent / "protocols" / "plans" / "conventional.yaml")
    tests = tuple(test for test in whole.tests if test.name in "dg")
    balls = {test.ball: whole.balls[test.ball] for test in tests}
    inline = whole.model_copy(update={"tests": tests, "balls": balls})
    virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, 7)), inline.to_domain(), seed=7)
    runs = []
    for test in tests:
        for direction in Direction:
            run = virtual.run(test.name, direction, begin_s=180.0 * len(runs))
            t_s = np.arange(0.0, run.path.duration_s, 0.2).round(7)
            length_mm = np.array([run.length_mm_at(float(t)) + virtual.noise_mm() for t in t_s])
            columns = {"t_s": t_s, "length_mm": length_mm.round(5)}
            started = BEGUN + timedelta(minutes=3 * len(runs))
            runs.append(FinishedRun(test.name, direction, columns, 1, run.mounting, started))
    rng = np.random.default_rng(7)
    readings = []
    for test, stands in zip(tests, virtual.describe()["set_up_errors"], strict=True):
        fixed, moving = (
            np.round(np.array(stands[key]) + rng.normal(0.0, 1.0, 3)).tolist()
            for key in ("fixed_ball_um", "moving_ball_um")
        )
        readings.append(
            SetUpReadings(
                test=test.name,
                mounting=stands["mounting"],
                fixed_ball_um=tuple(fixed),
                moving_ball_um=(*moving[:2], None),
                uncertainty_um=1.0,
            )
        )
    write_session(folder, machine, inline, runs, SessionDetails(set_up_errors=tuple(readings)))


def make_models(folder: Path) -> None:
    session = read_session(FIXTURES / "sessions" / "small")
    known, machine = known_sources(), session.machine
    run = session.runs[0]
    setup = session.setup(run)
    rng = np.random.default_rng(7)
    fitted = (
        Fitted(known["strut-reference-length"], rng.normal(0.0, 0.05, 6).round(5)),
        Fitted(known["bar-offset"], np.array([0.0002]), setup.session),
        Fitted(known["mounting"], np.array([0.0003, -0.0001, 0.0005]), setup.mounting),
    )
    rows = tuple((one.source.name, one.shared, p.name) for one in fitted for p in one.source.parameters(machine))
    mixed = np.diag(np.array([2e-4] * 6 + [4e-4] + [5e-4] * 3)) @ (np.eye(10) + 0.3 * rng.standard_normal((10, 10)))
    covariance = np.array([[float(f"{value:.4g}") for value in row] for row in mixed @ mixed.T])
    model = IdentifiedModel(
        MachineModel(machine, fitted),
        rows,
        covariance,
        ("all six base joints together along Z",),
        {"residual_rms_um": 0.52, "parameters_identified": 6, "made_up": True},
        {session.name: session.sha256},
    )
    write_model(folder / "small.yaml", model, force=True)
    origin = Provenance("dbbstation 0.1.0", "dbbstation calibrate small", {"small/session.yaml": session.sha256})
    lengths = {f"strut_{k}_mm": 0.01 * k for k in range(1, 7)}
    control = ControlCorrection("kinematics", "0123456789abcdef" * 4, "2026-11-27", {"strut-reference-length": lengths})
    planned = replace(machine, greatest_feed_mm_min=20_000.0, acceleration_mm_s2=1500.0, control=control)
    every = replace(
        model,
        model=MachineModel(planned, fitted),
        directions_lost=("all six struts together in length",),
        null_space=np.array([[0.08] * 6 + [0.0] * 4]),
        formula_variance=np.array([1e-8] * 6 + [0.0] * 4),
    )
    write_model(folder / "every-key.yaml", every, provenance=origin, force=True)


def make_begun_session(folder: Path) -> None:
    """A session that ended before its first circle."""
    whole = read_session(FIXTURES / "sessions" / "logged")
    plan = read_inline_plan(FIXTURES / "sessions" / "logged" / "plan.yaml")
    details = SessionDetails(job="order 4711")
    with SessionWriter.create(folder, whole.machine, plan, details, lambda: BEGUN):
        pass
    (folder / ".lock").unlink()


if __name__ == "__main__":
    for name, made in (
        ("logged", make_session),
        ("begun", make_begun_session),
        ("virtual", make_virtual_session),
    ):
        shutil.rmtree(FIXTURES / "sessions" / name, ignore_errors=True)
        made(FIXTURES / "sessions" / name)
    make_models(FIXTURES / "models")
