"""Sound sessions of the plant, and single runs of them spoilt by a known amount.

`python -m tests.quality.sabotage` prints the table of docs/circles.md: how often each finding is made of runs that are spoilt by
half its limit, by its limit and by twice its limit, and how often of runs that are sound. `--equipment 3` prints the table of what goes
wrong with balls, programs and gauges, and `--drifting 1000` how often good circles on drifting days have a finding.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.files.formats.model import read_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.recordings.judged import runs_of
from dbbstation.files.recordings.session import read_session
from dbbstation.model.identified import IdentifiedModel
from dbbstation.plan.circle import Circle
from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.judge import Judgement, SessionRuns
from dbbstation.quality.knowledge import HIGHEST_HARMONIC, Run, Seen, seen
from dbbstation.trace.cut import edges_of, progress_deg
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
from tests.plant.plan import subset, table_ii_plan
from tests.plant.run import Slot
from tests.plant.session import Reprogram, record

SHARES = (0.5, 1.0, 2.0)
"""Sizes of what is spoilt, as shares of the limit."""

NOISE = Noise(white_um=0.4, correlated_um=0.4, correlation=0.7)
"""Noise of a reading: coloured, as the bar of the recordings made elsewhere has it."""

REPEATED = ("a", "f", "h", "k", "n")


@dataclass(frozen=True)
class Sound:
    """A session with nothing wrong but what every machine has, analysed once."""

    runs: list[Seen]

    def judged(self) -> list[Judgement]:
        session = SessionRuns(self.runs)
        return [session.judge(one) for one in self.runs]

    def with_spoilt(self, run: int, recording: Recording) -> Judgement:
        """Judge one run with another recording beside the others as they are."""
        one = seen(replace(self.runs[run].run, recording=recording))
        return SessionRuns([*self.runs[:run], one, *self.runs[run + 1 :]]).judge(one)


def sound(
    folder: Path,
    seed: int,
    tests: str = "abcdefghijklmno",
    rate_hz: float = 50.0,
    also: Sequence[Mechanism] = (),
    noise: Noise = NOISE,
    reprogram: Reprogram | None = None,
) -> Sound:
    """Kinematic errors, gravity, backlash and lag of a machine of its own, usual scatter of balls and bar, noise."""
    rng = np.random.default_rng([seed, 35])
    plan = subset(table_ii_plan(seed), list(tests))
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
    return Sound([seen(run) for run in runs_of(session, wanted, model)])


def calibrated(folder: Path, seed: int) -> Sound:
    """A session whose circles are expected where its own calibration puts them."""
    sound(folder / "spoilt", seed, TESTS)
    outcome = call("calibrate", folder / "spoilt", "--out", folder / "model.yaml")
    assert outcome.code == 0, outcome.err
    return read(folder / "spoilt", read_model(folder / "model.yaml", every_source(())))


def progress(recording: Recording, circle: Circle) -> np.ndarray:
    return progress_deg(recording, circle, edges_of(recording, circle))


def _longer(recording: Recording, by_um: np.ndarray) -> Recording:
    return replace(recording, length_mm=recording.length_mm + 1e-3 * by_um)


def lost(recording: Recording, circle: Circle, percent: float) -> Recording:
    phi = progress(recording, circle)
    turn = np.flatnonzero((phi >= 0.0) & (phi < 360.0))
    count = round(percent / 100.0 * len(turn))
    keep = np.ones(len(recording), dtype=bool)
    keep[turn[100 + 2 * np.arange(count)]] = False
    return replace(recording, t_s=recording.t_s[keep], length_mm=recording.length_mm[keep])


def noisy(recording: Recording, _circle: Circle, um: float) -> Recording:
    return _longer(recording, np.random.default_rng(7).normal(0.0, um, len(recording)))


def unclosed(recording: Recording, circle: Circle, um: float) -> Recording:
    """Longer from shortly before the turn's end until shortly behind it."""
    phi = progress(recording, circle)
    return _longer(recording, um * (np.clip((phi - 335.0) / 10.0, 0.0, 1.0) - np.clip((phi - 365.0) / 10.0, 0.0, 1.0)))


def drifting(recording: Recording, circle: Circle, um: float) -> Recording:
    return _longer(recording, um * progress(recording, circle) / 360.0)


def bumpy(recording: Recording, circle: Circle, um: float, at_deg: float = 112.0) -> Recording:
    phi = progress(recording, circle)
    place = circle.phi_deg(np.array([at_deg]))[0]
    return _longer(recording, um * np.exp(-0.5 * (phi - place) ** 2))


def spiky(recording: Recording, circle: Circle, um: float, at_deg: float = 112.0) -> Recording:
    """One reading that stands off its neighbours."""
    apart = np.abs(progress(recording, circle) - circle.phi_deg(np.array([at_deg]))[0])
    one = np.zeros(len(recording))
    one[int(np.argmin(apart))] = um
    return _longer(recording, one)


def quiet_deg(one: Run) -> float:
    """Angle of a circle that is farthest from reversals of struts, and from the start of the turn."""
    assert one.expected is not None
    theta = np.arange(20.0, 340.0)
    places = np.array(one.expected.reversals_deg)
    away = np.abs(np.mod(theta[:, None] - places + 180.0, 360.0) - 180.0).min(axis=1)
    return float(theta[int(np.argmax(away))])


def mirrored(recording: Recording, circle: Circle, share: float) -> Recording:
    """So much of the circle's form turned round: all of it where share is one."""
    phi = progress(recording, circle)
    on_arc = (phi > -circle.overshoot_deg) & (phi < 360.0 + circle.overshoot_deg)
    back = np.interp(np.mod(-phi, 360.0), *_turn(recording, phi))
    forth = np.interp(np.mod(phi, 360.0), *_turn(recording, phi))
    return replace(recording, length_mm=recording.length_mm + np.where(on_arc, share * (back - forth), 0.0))


def begun_elsewhere(recording: Recording, circle: Circle, by_deg: float) -> Recording:
    """The turn begun at an angle that is not the plan's: its form is found turned by as much."""
    phi = progress(recording, circle)
    on_arc = (phi > -circle.overshoot_deg) & (phi < 360.0 + circle.overshoot_deg)
    there = np.interp(np.mod(phi + by_deg, 360.0), *_turn(recording, phi))
    here = np.interp(np.mod(phi, 360.0), *_turn(recording, phi))
    return replace(recording, length_mm=recording.length_mm + np.where(on_arc, there - here, 0.0))


def _turn(recording: Recording, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Form of the turn up to eight undulations: what is mirrored is form, not noise."""
    turn = (phi >= 0.0) & (phi < 360.0)
    orders = np.outer(np.radians(phi[turn]), np.arange(1, 9))
    columns = np.hstack([np.ones((len(orders), 1)), np.cos(orders), np.sin(orders)])
    found, *_ = np.linalg.lstsq(columns, recording.length_mm[turn], rcond=None)
    even = np.linspace(0.0, 360.0, 1441)
    orders = np.outer(np.radians(even), np.arange(1, 9))
    return even, np.hstack([np.ones((len(orders), 1)), np.cos(orders), np.sin(orders)]) @ found


def larger(recording: Recording, _circle: Circle, um: float) -> Recording:
    return _longer(recording, np.full(len(recording), um))


def at_feed(recording: Recording, circle: Circle, mm_min: float) -> Recording:
    """Run at another feed than programmed."""
    edges = edges_of(recording, circle)
    middle = 0.5 * (edges[0] + edges[1])
    t_s = middle + (recording.t_s - middle) * circle.feed_mm_min / (circle.feed_mm_min + mm_min)
    return replace(recording, t_s=t_s - t_s[0])


def elsewhere(recording: Recording, circle: Circle, um: float) -> Recording:
    """About a ball that stands beside its place, in the direction in which the circle lies off already."""
    theta = np.radians(circle.theta_deg(progress(recording, circle)))
    return _longer(recording, um * np.cos(theta - np.pi / 4.0))


def oval(recording: Recording, circle: Circle, um: float) -> Recording:
    phi = np.radians(progress(recording, circle))
    return _longer(recording, np.sqrt(2.0) * um * np.cos(2.0 * phi))


SPOILERS: dict[Name, Callable[..., Recording]] = {
    Name.LOST: lost,
    Name.NOISE: noisy,
    Name.CLOSURE: unclosed,
    Name.DRIFT: drifting,
    Name.BUMP: bumpy,
    Name.SPIKE: spiky,
    Name.DIRECTION: mirrored,
    Name.RADIUS: larger,
    Name.FEED: at_feed,
    Name.BORE: elsewhere,
    Name.OTHER_DIRECTION: oval,
    Name.REPEAT: oval,
}


def finding_of(judgement: Judgement, name: Name) -> Finding | None:
    return next((finding for finding in judgement.findings if finding.name is name), None)


DRIFTS_UM_MIN, WARMINGS_K_H = (0.0, 1.0), (0.0, 1.0)
"""Bar's drift and warming of struts and frame, from and to, that good circles have [µm/min, K/h]."""


def drifting_session(folder: Path, seed: int) -> Sound:
    """A good session on a day of its own: drift, warming, and noise that is white or remembers."""
    rng = np.random.default_rng([seed, 134])
    rise_k, slow_s = 100.0 * rng.uniform(*WARMINGS_K_H), 360e3
    warming = Warming(rise_k=rise_k, time_constant_s=slow_s)
    white_um, correlated_um = float(rng.uniform(0.1, 0.6)), float(rng.choice([0.0, 0.4]))
    noise = Noise(white_um=white_um, correlated_um=correlated_um, correlation=float(rng.uniform(0.5, 0.9)))
    also = (ThermalStruts(warming=warming), ThermalFrame(warming=warming))
    whole = sound(folder, seed, also=also, noise=noise)
    um_s = rng.uniform(*DRIFTS_UM_MIN) / 60.0
    return Sound([seen(replace(one.run, recording=_warmed(one.run, um_s))) for one in whole.runs])


def _warmed(run: Run, um_s: float) -> Recording:
    assert run.started_s is not None
    return _longer(run.recording, um_s * (run.started_s + run.recording.t_s))


class Fault(StrEnum):
    """What goes wrong with the equipment, as whole: not how large the number of a finding comes out."""

    OTHER_TEST = "program and ball of another test"
    TILT = "wrong tilt"
    START = "wrong start"
    DIRECTION = "wrong direction"
    KNOCKED = "knocked ball"
    STUCK = "stuck length"
    CLIPPED = "clipped length"


SIZES: dict[Fault, tuple[float, ...]] = {
    Fault.TILT: (1.0, 5.0, 15.0),
    Fault.START: (5.0, 30.0, 180.0),
    Fault.KNOCKED: (1.0, 2.0, 5.0),
    Fault.STUCK: (1.0, 2.0, 5.0),
    Fault.CLIPPED: (1.0, 2.0, 5.0),
}
"""Tilt and start are off by so many degrees, a ball by as many limits, a length stands still for as many limits."""


class When(StrEnum):
    """What the session knows already."""

    FIRST = "first pair"
    LATER = "later"
    REPEATED = "after a repeat"


def before(whole: Sound, spoilt: Seen, when: When) -> list[Seen]:
    """Runs that count before a run is judged."""
    own = [one for one in whole.runs if one.run.test == spoilt.run.test and one.run.repeat == 1]
    own = [one for one in own if one.run.circle.direction is not spoilt.run.circle.direction]
    rest = [one for one in whole.runs if one.run.test != spoilt.run.test]
    return [*rest, *own] if when is When.LATER else own


def faulty(whole: Sound, tilted: dict[float, Sound], run: int, fault: Fault, size: float, known: list[Seen]) -> Seen:
    """One run with a fault of a size."""
    one = whole.runs[run].run
    if fault is Fault.OTHER_TEST:
        return seen(replace(one, recording=whole.runs[int(size)].run.recording))
    if fault is Fault.TILT:
        return seen(replace(one, recording=tilted[size].runs[run].run.recording))
    if fault is Fault.START:
        return seen(replace(one, recording=begun_elsewhere(one.recording, one.circle, size)))
    if fault is Fault.DIRECTION:
        return seen(replace(one, recording=mirrored(one.recording, one.circle, 1.0)))
    name = Name.OTHER_DIRECTION if fault is Fault.KNOCKED else Name.HELD
    found = finding_of(SessionRuns([*known, whole.runs[run]]).judge(whole.runs[run]), name)
    limit = 0.0 if found is None or found.limit is None else found.limit
    if fault is Fault.KNOCKED:
        # A shift d shows as d / sqrt 2 in the rms of the form, on top of what is there.
        return seen(replace(one, recording=elsewhere(one.recording, one.circle, np.sqrt(2.0) * size * limit)))
    return seen(
        replace(one, recording=standing(one.recording, one.circle, size * limit, clipped=fault is Fault.CLIPPED))
    )


def standing(recording: Recording, circle: Circle, held_s: float, *, clipped: bool) -> Recording:
    """A length that stands still for a while in the middle of the turn, or that goes no farther than what it has there."""
    phi = progress(recording, circle)
    first = int(np.searchsorted(phi, 140.0))
    last = int(np.searchsorted(recording.t_s, recording.t_s[first] + held_s))
    length_mm = recording.length_mm.copy()
    inside = slice(first, last + 1)
    length_mm[inside] = np.quantile(length_mm[inside], 0.02) if clipped else length_mm[first]
    return replace(recording, length_mm=length_mm)


@dataclass(frozen=True)
class Spoilt:
    """One run, spoilt by a share of a limit."""

    name: Name
    share: float
    value: float | None
    limit: float
    verdict: FindingVerdict
    also: tuple[str, ...]


def spoil(whole: Sound, run: int, name: Name) -> Iterator[Spoilt]:
    """Spoil a run so that its value comes to each share of its limit, as far as it can be brought there."""
    before = finding_of(whole.judged()[run], name)
    assert before is not None
    assert before.limit is not None, before.text
    limit = _limit_of_fault(whole, run, name, before.limit)
    for share in SHARES:
        judged = _spoilt(whole, run, name, _size(whole, run, name, share * limit))
        after = finding_of(judged, name)
        others = tuple(f"{f.name}" for f in judged.wrong if f.name is not name)
        verdict = FindingVerdict.CANNOT_TELL if after is None else after.verdict
        yield Spoilt(name, share, None if after is None else after.value, limit, verdict, others)


def _limit_of_fault(whole: Sound, run: int, name: Name, limit: float) -> float:
    """The limit in the direction in which a fault moves the form, where that has a direction: that of a large one."""
    if name not in {Name.OTHER_DIRECTION, Name.REPEAT}:
        return limit
    found = finding_of(_spoilt(whole, run, name, 5.0 * limit), name)
    assert found is not None
    assert found.limit is not None
    return found.limit


def _spoilt(whole: Sound, run: int, name: Name, size: float) -> Judgement:
    one = whole.runs[run].run
    if name is Name.DIRECTION:
        return _wrong_way(whole, run, size)
    if name in {Name.BUMP, Name.SPIKE}:
        return whole.with_spoilt(run, SPOILERS[name](one.recording, one.circle, size, quiet_deg(one)))
    return whole.with_spoilt(run, SPOILERS[name](one.recording, one.circle, size))


def _wrong_way(whole: Sound, run: int, apart_um: float) -> Judgement:
    """Run the wrong way round on a mounting where the circle lies half of `apart_um` off the axis through its start."""
    one = whole.runs[run]
    other = next(
        k
        for k, o in enumerate(whole.runs)
        if o.run.mounting == one.run.mounting and o.run.circle.direction is not one.run.circle.direction
    )
    moved = {k: _put_across(whole.runs[k], 0.5 * apart_um) for k in (run, other)}
    runs = [seen(replace(o.run, recording=moved[k])) if k in moved else o for k, o in enumerate(whole.runs)]
    return Sound(runs).with_spoilt(run, mirrored(runs[run].run.recording, runs[run].run.circle, 1.0))


def _put_across(one: Seen, um: float) -> Recording:
    """Bring the first sine of a circle to a size and take its third away: what is left is a shift."""
    circle, recording = one.run.circle, one.run.recording
    theta = np.radians(circle.theta_deg(progress(recording, circle)) - circle.start_deg)
    first, _, third = one.coefficients_um[HIGHEST_HARMONIC + 1 :]
    return _longer(recording, np.sqrt(2.0) * ((um - first) * np.sin(theta) - third * np.sin(3.0 * theta)))


def _size(whole: Sound, run: int, name: Name, wanted: float) -> float:
    """Size of the fault at which the value comes to what is wanted: values grow about as their fault does."""
    if name in {Name.LOST, Name.FEED, Name.DIRECTION}:
        return wanted
    size = wanted
    for _ in range(ROUNDS):
        found = finding_of(_spoilt(whole, run, name, size), name)
        assert found is not None
        assert found.value is not None, found.text
        if abs(found.value / wanted - 1.0) < 0.01:
            break
        size *= wanted / found.value
    return size


ROUNDS = 8
"""Corrections of a fault's size: some faults join what noise shows already, and their value is not quite proportional."""


TESTS = "abdfhjkn"
"""Tests of the sessions that are spoilt: three heights, tilted and level."""


def tilted_by(folder: Path, seed: int, degrees: float) -> Sound:
    """The same machine and the same day, all circles tilted by so much more about X."""

    def more(_slot: Slot, poses: np.ndarray) -> np.ndarray:
        return poses + np.array([0.0, 0.0, 0.0, degrees, 0.0, 0.0])

    return sound(folder, seed, TESTS, reprogram=more)


Row = collections.Counter[tuple[Fault, float, When, bool, str]]


def equipment(folder: Path, seed: int) -> Row:
    """Judge each run of a session with each fault, as it would be judged at the machine; count what comes of it."""
    counted: Row = collections.Counter()
    modelled = calibrated(folder, seed)
    for with_model in (False, True):
        whole = modelled if with_model else read(folder / "spoilt")
        tilted = {
            degrees: tilted_by(folder / f"t{degrees}{with_model}", seed, degrees) for degrees in SIZES[Fault.TILT]
        }
        runs = [k for k, one in enumerate(whole.runs) if one.run.repeat == 1]
        # The second direction of each test: the first has been accepted.
        seconds = [k for n, k in enumerate(runs) if n % 2 == 1]
        for run in seconds:
            for when in When:
                _count(counted, whole, tilted, run, when, with_model=with_model)
    return counted


def _count(counted: Row, whole: Sound, tilted: dict[float, Sound], run: int, when: When, *, with_model: bool) -> None:
    one = whole.runs[run]
    known = before(whole, one, when)
    alike = [
        k
        for k, o in enumerate(whole.runs)
        if o.run.test != one.run.test and o.run.repeat == 1 and o.run.circle.direction is one.run.circle.direction
    ]
    for fault in Fault:
        for size in alike if fault is Fault.OTHER_TEST else SIZES.get(fault, (1.0,)):
            spoilt = faulty(whole, tilted, run, fault, size, known)
            if when is When.REPEATED:
                # The run before was wrong in the same way, and rejected; this is its repeat.
                spoilt = replace(spoilt, run=replace(spoilt.run, repeat=2))
            judged = SessionRuns([*known, spoilt]).judge(spoilt)
            shown = 0.0 if fault is Fault.OTHER_TEST else size
            counted[fault, shown, when, with_model, "of"] += 1
            counted[fault, shown, when, with_model, "found"] += bool(judged.wrong)


def print_equipment(counted: Row) -> None:
    """The table of docs/circles.md: found, of how many."""
    heads = [(when, with_model) for with_model in (False, True) for when in When]
    titles = [f"{when}{', model' if with_model else ''}" for when, with_model in heads]
    sys.stdout.write(f"| fault | size | {' | '.join(titles)} |\n|{' --- |' * (len(heads) + 2)}\n")
    for fault in Fault:
        for size in sorted({key[1] for key in counted if key[0] is fault}):
            cells = [f"{counted[fault, size, *head, 'found']} of {counted[fault, size, *head, 'of']}" for head in heads]
            shown = f"{size:g}" if fault in SIZES else ""
            sys.stdout.write(f"| {fault} | {shown} | {' | '.join(cells)} |\n")


def false_alarms(folder: Path, seed: int, wanted: int) -> None:
    """Good circles on drifting days, each judged at the machine, beside those before it, and in the end, beside all."""
    seen_so_far = 0
    alarms: dict[str, collections.Counter[str]] = {
        "at the machine": collections.Counter(),
        "in the end": collections.Counter(),
    }
    while seen_so_far < wanted:
        whole = drifting_session(folder / f"drift{seed}", seed)
        session = SessionRuns(whole.runs)
        for k, one in enumerate(whole.runs[: wanted - seen_so_far]):
            live = SessionRuns(whole.runs[: k + 1]).judge(one)
            for name, judged in (("at the machine", live), ("in the end", session.judge(one))):
                alarms[name]["circles"] += bool(judged.wrong)
                alarms[name].update(str(f.name) for f in judged.wrong)
                for f in judged.wrong:
                    sys.stderr.write(f"{seed} {name} {one.run.label}: {f.name} {f.value} > {f.limit}: {f.text}\n")
        seen_so_far += min(len(whole.runs), wanted - seen_so_far)
        seed += 1
    for name, counted in alarms.items():
        sys.stdout.write(f"{wanted} good circles on drifting days, {name}: {dict(counted)}\n")


@with_one_thread
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drifting", type=int, default=0, help="good circles on drifting days, in place of all else")
    parser.add_argument("--equipment", type=int, default=0, help="sessions whose equipment fails, in place of all else")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.drifting:
            false_alarms(Path(folder), given.seed, given.drifting)
        counted: Row = collections.Counter()
        for seed in range(given.seed, given.seed + given.equipment):
            counted.update(equipment(Path(folder) / str(seed), 1000 + seed))
        if given.equipment:
            print_equipment(counted)
    if given.drifting or given.equipment:
        return
    wrong: collections.Counter[str] = collections.Counter()
    untold: collections.Counter[str] = collections.Counter()
    seen = alarmed = 0
    with tempfile.TemporaryDirectory() as folder:
        seed = given.seed
        while seen < given.clean:
            whole = sound(Path(folder) / f"clean{seed}", seed)
            for judgement in whole.judged()[: given.clean - seen]:
                seen += 1
                alarmed += bool(judgement.wrong)
                wrong.update(f"{f.name}" for f in judgement.wrong)
                untold.update(f"{f.name}" for f in judgement.findings if f.verdict is FindingVerdict.CANNOT_TELL)
                for f in judgement.wrong:
                    sys.stderr.write(f"{seed} {judgement.run.label}: {f.name} {f.value} > {f.limit}: {f.text}\n")
            seed += 1
        sys.stdout.write(
            f"{seen} sound circles: {alarmed} with a finding; {dict(wrong)}; cannot tell: {dict(untold)}\n"
        )
        whole = calibrated(Path(folder), 1000 + given.seed)
        repeated = next(k for k, one in enumerate(whole.runs) if one.run.label == "h ccw 2")
        for name in SPOILERS:
            for one in spoil(whole, repeated, name):
                value = "-" if one.value is None else f"{one.value:.2f}"
                sys.stdout.write(
                    f"{name:16} {one.share:3} limit {one.limit:9.2f} value {value:>9} {one.verdict:12} {', '.join(one.also)}\n"
                )


if __name__ == "__main__":
    main()
