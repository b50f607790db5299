"""Makes whole session folders with a known truth."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tests.plant.arrays import FloatArray
from tests.plant.drive_path import RunPath, Timing
from tests.plant.files import machine_text, plan_text, recording_text, session_text
from tests.plant.machine import Machine, reference_machine, rounded
from tests.plant.mechanisms.balls import CmmScatter, MountingScatter
from tests.plant.mechanisms.bar import RandomBarOffset
from tests.plant.noise import Noise
from tests.plant.plan import Plan, table_ii_plan
from tests.plant.run import Motion, Scene, Slot
from tests.plant.simulate import Outcome, simulate
from tests.plant.truth import TrueRun, Truth

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from tests.plant.mechanisms.base import Mechanism

BEGUN = datetime(2026, 11, 20, 8, 0, 0, tzinfo=UTC)
SPACING_S = 200.0
MEANS_OF_TWO_HZ = 13.0
"""A little more than 720 readings a turn at the usual feed: a diagnosis takes means of two, half as many rows as of 25 Hz."""
Reprogram: TypeAlias = Callable[[Slot, FloatArray], FloatArray]
"""From a run and its nominal commanded poses `(n, 6)` to what a compensated program commands instead."""


@dataclass(frozen=True)
class Program:
    """The text of an NC program that was run instead of the plain circle, and the model that it came from."""

    text: str
    model_sha256: str | None = None
    ending: str = "ngc"


def usual_setup() -> tuple[Mechanism, ...]:
    """The errors of set-up that every real session has: mountings, CMM entries, length of the bar."""
    return (MountingScatter(), CmmScatter(), RandomBarOffset())


def record(
    folder: FilePath,
    *,
    seed: int,
    plan: Plan | None = None,
    machine: Machine | None = None,
    mechanisms: Sequence[Mechanism] = (),
    setup: Sequence[Mechanism] | None = None,
    noise: Noise | None = None,
    rate_hz: float = 50.0,
    timing: Timing | None = None,
    angles: bool = False,
    mounting_numbers: bool = True,
    crc: bool = False,
    begun: datetime = BEGUN,
    reprogram: Reprogram | None = None,
    programs: Mapping[str, Program] | None = None,
    breaks_s: Mapping[str, float] | None = None,
) -> Truth:
    """Simulates a session and writes its folder, `dbb-session/1`.

    `mechanisms` is what is wrong with the machine, `setup` what is wrong with balls and bar (the usual errors if left
    out). With `angles` the recordings carry `theta_deg` and are cut to the circle; without `mounting_numbers` the runs
    of a test share one mounting, as the format says of sessions that count none. A compensated session needs both: what
    is commanded instead (`reprogram`), and the `programs` that say so, by test and direction as in "a-cw". `breaks_s` are
    pauses before tests, by name.
    """
    plan = plan or table_ii_plan(seed)
    machine = rounded(machine or reference_machine())
    noise = noise or Noise()
    scene = scene_of(plan, machine, timing, breaks_s, mounting_numbers=mounting_numbers)
    decided = _decided(seed, scene, [*mechanisms, *(usual_setup() if setup is None else setup)])
    (folder / "runs").mkdir(parents=True)
    runs: list[TrueRun] = []
    entries = []
    for slot in scene.slots:
        run, outcome = simulate_run(scene, slot, decided, rate_hz, _phase_s(seed, slot, rate_hz), reprogram)
        runs.append(run)
        rng = _rng(seed, f"noise {slot.stem}")
        read_mm = run.length_mm + noise.drawn_mm(rng, len(run.time_s))
        text = recording_text(slot, _columns(run, outcome, read_mm, decided, angles=angles), crc=crc)
        (folder / "runs" / f"{slot.stem}.csv").write_text(text, encoding="utf-8", newline="\n")
        entry = _run_entry(slot, begun, text, mounting_numbers=mounting_numbers)
        name = f"{slot.test.name}-{slot.direction}"
        if programs and name in programs:
            entry["program"] = _program_entry(folder, name, programs[name])
        entries.append(entry)
    (folder / "machine.yaml").write_text(machine_text(machine), encoding="utf-8")
    (folder / "plan.yaml").write_text(plan_text(plan), encoding="utf-8")
    bar = {
        "serial_number": "DBB-0042",
        "calibrated_length_mm": plan.path.radius_mm,
        "calibrator_uncertainty_mm": 0.0005,
    }
    head = {"ambient_temp_c": scene.ambient_temp_c, "bar": bar}
    (folder / "session.yaml").write_text(session_text(head, entries), encoding="utf-8")
    return Truth(seed, folder, scene, decided, noise, tuple(runs))


def true_runs(
    plan: Plan,
    mechanisms: Sequence[Mechanism],
    machine: Machine | None = None,
    rate_hz: float = 5.0,
    timing: Timing | None = None,
) -> list[TrueRun]:
    """The runs of a session without noise and without writing anything, for quick looks at what a mechanism does.

    Mechanisms with anything random in them must have been decided before.
    """
    scene = scene_of(plan, machine, timing)
    return [simulate_run(scene, slot, mechanisms, rate_hz)[0] for slot in scene.slots]


def simulate_run(
    scene: Scene,
    slot: Slot,
    mechanisms: Sequence[Mechanism],
    rate_hz: float,
    phase_s: float = 0.0,
    reprogram: Reprogram | None = None,
) -> tuple[TrueRun, Outcome]:
    """One run without noise; `phase_s` is how far into the first dwell the first sample falls."""
    count = int(np.floor((slot.path.duration_s - phase_s) * rate_hz)) + 1
    time_s = np.arange(count) / rate_hz
    poses = slot.path.poses(time_s + phase_s)
    motion = Motion(scene, slot.start_s + phase_s + time_s, poses, slot)
    shift_s = sum(
        (np.asarray(shift) for item in mechanisms if (shift := item.sampled_s(motion)) is not None), start=0.0
    )
    true_s = time_s + phase_s + shift_s
    poses = slot.path.poses(true_s)
    if reprogram is not None:
        poses = reprogram(slot, poses)
    outcome = simulate(Motion(scene, slot.start_s + true_s, poses, slot), mechanisms)
    # Angles and cut are what the programmer believes: they go by the time written down.
    theta_deg, in_circle = motion.angle_deg, motion.in_circle
    return TrueRun(slot, time_s, theta_deg, in_circle, outcome.length_mm), outcome


def scene_of(
    plan: Plan,
    machine: Machine | None = None,
    timing: Timing | None = None,
    breaks_s: Mapping[str, float] | None = None,
    *,
    mounting_numbers: bool = True,
) -> Scene:
    """What is fixed before a session begins: the machine as its file prints it, and when each run begins."""
    slots = _slots(plan, timing or Timing(), breaks_s or {}, mounting_numbers=mounting_numbers)
    return Scene(rounded(machine or reference_machine()), plan, slots)


def _slots(plan: Plan, timing: Timing, breaks_s: Mapping[str, float], *, mounting_numbers: bool) -> tuple[Slot, ...]:
    """The runs in order. Every test, and every repetition at the end, puts its ball up anew."""
    slots: list[Slot] = []
    repeats: dict[str, int] = {}
    mountings: dict[str, int] = {}
    for test in [*plan.tests, *(plan.test(name) for name in plan.repeat_at_end)]:
        repeats[test.name] = repeats.get(test.name, 0) + 1
        waited_s = breaks_s.get(test.name, 0.0) if repeats[test.name] == 1 else 0.0
        if mounting_numbers or test.name not in mountings:
            mountings[test.name] = max(mountings.values(), default=0) + 1
        for direction in plan.path_of(test).directions:
            path = RunPath(plan, test, direction, timing)
            # Runs begin at whole spacings; a slow or long circle pushes those after it back.
            start_s = SPACING_S * float(np.ceil(slots[-1].end_s / SPACING_S)) + waited_s if slots else 0.0
            waited_s = 0.0
            slots.append(Slot(test, direction, repeats[test.name], mountings[test.name], start_s, path))
    return tuple(slots)


def _decided(seed: int, scene: Scene, mechanisms: Sequence[Mechanism]) -> tuple[Mechanism, ...]:
    """Every mechanism with its own random stream, so that adding one does not change what the others draw."""
    seen: dict[str, int] = {}
    decided = []
    for mechanism in mechanisms:
        seen[mechanism.name] = seen.get(mechanism.name, 0) + 1
        decided.append(mechanism.drawn(_rng(seed, f"{mechanism.name} {seen[mechanism.name]}"), scene))
    return tuple(decided)


def _rng(seed: int, stream: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(stream.encode())])


def _phase_s(seed: int, slot: Slot, rate_hz: float) -> float:
    """The recorder starts when it likes: the first sample falls anywhere in the first sampling interval."""
    return float(_rng(seed, f"phase {slot.stem}").uniform(0.0, 1.0 / rate_hz))


def _columns(
    run: TrueRun, outcome: Outcome, read_mm: FloatArray, mechanisms: Sequence[Mechanism], *, angles: bool
) -> dict[str, FloatArray]:
    columns = {"t_s": run.time_s, "length_mm": read_mm}
    if angles:
        columns["theta_deg"] = np.mod(run.theta_deg, 360.0)
    for mechanism in mechanisms:
        columns |= mechanism.columns(outcome.motion, outcome.platform)
    if angles:
        columns = {name: values[run.in_circle] for name, values in columns.items()}
        columns["t_s"] = columns["t_s"] - columns["t_s"][0]
    return columns


def _run_entry(slot: Slot, begun: datetime, text: str, *, mounting_numbers: bool) -> dict[str, object]:
    started = begun + timedelta(seconds=slot.start_s)
    return {
        "test": slot.test.name,
        "direction": slot.direction,
        "repeat": slot.repeat,
        **({"mounting": slot.mounting} if mounting_numbers else {}),
        "file": f"runs/{slot.stem}.csv",
        "started": started.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "state": "accepted",
        "sha256": hashlib.sha256(text.encode()).hexdigest(),
    }


def _program_entry(folder: FilePath, name: str, program: Program) -> dict[str, object]:
    file = f"programs/{name}.{program.ending}"
    (folder / "programs").mkdir(exist_ok=True)
    (folder / file).write_text(program.text, encoding="utf-8", newline="\n")
    entry: dict[str, object] = {"file": file, "sha256": hashlib.sha256(program.text.encode()).hexdigest()}
    return entry if program.model_sha256 is None else entry | {"model_sha256": program.model_sha256}
