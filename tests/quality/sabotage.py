"""Sound sessions of the plant, and single runs of them spoilt by a known amount.

`python -m tests.quality.sabotage` prints the table of docs/circles.md: how often each finding is made of runs that are spoilt by
half its limit, by its limit and by twice its limit, and how often of runs that are sound.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dbbstation.files.formats.model import read_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.recordings.judged import runs_of
from dbbstation.files.recordings.session import read_session
from dbbstation.model.identified import IdentifiedModel
from dbbstation.plan.circle import Circle
from dbbstation.quality.finding import Finding, Name, Verdict
from dbbstation.quality.judge import Judgement, SessionRuns
from dbbstation.quality.knowledge import HIGHEST_HARMONIC, Run, Seen, seen
from dbbstation.trace.cut import edges_of, progress_deg
from dbbstation.trace.recording import Recording
from tests.cli.conftest import call
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

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


def sound(folder: Path, seed: int, tests: str = "abcdefghijklmno", rate_hz: float = 50.0) -> Sound:
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
    record(folder, seed=seed, plan=plan, mechanisms=mechanisms, noise=NOISE, rate_hz=rate_hz)
    return read(folder)


def read(folder: Path, model: IdentifiedModel | None = None) -> Sound:
    session = read_session(folder)
    wanted = [(run, session.load(run).recording) for run in session.runs]
    return Sound([seen(run) for run in runs_of(session, wanted, model)])


def calibrated(folder: Path, seed: int) -> Sound:
    """A session whose circles are expected where its own calibration puts them."""
    sound(folder / "spoilt", seed, "abdfhjkn")
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


@dataclass(frozen=True)
class Spoilt:
    """One run, spoilt by a share of a limit."""

    name: Name
    share: float
    value: float | None
    limit: float
    verdict: Verdict
    also: tuple[str, ...]


def spoil(whole: Sound, run: int, name: Name) -> Iterator[Spoilt]:
    """Spoil a run so that its value comes to each share of its limit, as far as it can be brought there."""
    before = finding_of(whole.judged()[run], name)
    assert before is not None
    assert before.limit is not None, before.text
    for share in SHARES:
        judged = _spoilt(whole, run, name, _size(whole, run, name, share * before.limit))
        after = finding_of(judged, name)
        others = tuple(f"{f.name}" for f in judged.wrong if f.name is not name)
        verdict = Verdict.CANNOT_TELL if after is None else after.verdict
        yield Spoilt(name, share, None if after is None else after.value, before.limit, verdict, others)


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
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
                untold.update(f"{f.name}" for f in judgement.findings if f.verdict is Verdict.CANNOT_TELL)
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
