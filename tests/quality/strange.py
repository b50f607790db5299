"""Faults of other kinds than those of `equipment`, and what becomes of each: the word on the run, and how far its circle is wrong."""

from __future__ import annotations

import collections
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from dbbstation.plan.plan import Circle
from dbbstation.quality.answer import Advice, answer
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Seen, seen
from dbbstation.trace.cut import edges_of
from dbbstation.trace.recording import Recording
from tests.plant.plan import HOLDER_HEIGHT_MM, Ball, Plan, subset, table_ii_plan
from tests.quality.equipment import When, before
from tests.quality.sessions import TESTS, calibrated, read, sound
from tests.quality.spoilers import begun_elsewhere, longer, mirrored, progress, turned


class Shared(StrEnum):
    """Which runs have a fault."""

    RUN = "this run"
    TEST = "both directions"
    ALL = "all runs"


Spoiler = Callable[[Recording, Circle, float], Recording]


def slipped(recording: Recording, circle: Circle, um: float) -> Recording:
    return longer(recording, np.where(progress(recording, circle) >= 180.0, um, 0.0))


def lifted(recording: Recording, circle: Circle, um: float) -> Recording:
    """A magnet cup comes off its ball by so much for half a second, and back."""
    since_s = (progress(recording, circle) - 200.0) / circle.turning_deg_s
    return longer(recording, np.where((since_s > 0.0) & (since_s < 0.5), um * np.sin(2.0 * np.pi * since_s), 0.0))


def slower_for_a_while(recording: Recording, circle: Circle, percent: float) -> Recording:
    """The override is turned down by so much over 60 degrees, and up again: what lies behind comes later."""
    phi = progress(recording, circle)
    share = 0.01 * percent
    first = recording.t_s[np.searchsorted(phi, 120.0)]
    wanted_s = 60.0 / circle.turning_deg_s
    late_s = recording.t_s - first
    path_s = np.where(
        late_s < 0.0,
        late_s,
        np.where(late_s < wanted_s / (1.0 - share), late_s * (1.0 - share), late_s - wanted_s * share / (1.0 - share)),
    )
    at = np.searchsorted(recording.t_s, first + path_s - 0.5 * float(np.median(np.diff(recording.t_s))))
    # It takes longer by what it lost: the recording goes on until the feed-out is through.
    kept = replace(recording, length_mm=recording.length_mm[np.minimum(at, len(recording) - 1)])
    rest = np.arange(int(at[-1]) + 1, len(recording))
    step_s = float(np.median(np.diff(recording.t_s)))
    more_s = recording.t_s[-1] + step_s * np.arange(1, len(rest) + 1)
    return replace(
        kept,
        t_s=np.append(kept.t_s, more_s),
        length_mm=np.append(kept.length_mm, recording.length_mm[rest]),
    )


def mirror_image(recording: Recording, circle: Circle, _size: float) -> Recording:
    """The control mirrors X: the circle begins on the other side and runs the other way round."""
    return turned(recording, circle, lambda phi: 180.0 - 2.0 * circle.direction.sign * circle.start_deg - phi)


def warmed_at_once(recording: Recording, circle: Circle, um: float) -> Recording:
    """A door opens half-way round: the bar takes another length with a time constant of half a minute."""
    since_s = (progress(recording, circle) - 180.0) / circle.turning_deg_s
    return longer(recording, um * (1.0 - np.exp(-np.maximum(since_s, 0.0) / 30.0)))


def warm_from_the_hand(recording: Recording, _circle: Circle, um: float) -> Recording:
    """A bar that was held in the hand cools down from the start on, by so much, with a time constant of a minute."""
    return longer(recording, um * np.exp(-recording.t_s / 60.0))


def begun_in_motion(recording: Recording, circle: Circle, share: float) -> Recording:
    first = edges_of(recording, circle)[0] + (share - 0.5) * circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    return _rows(recording, recording.t_s >= first)


def ended_in_motion(recording: Recording, circle: Circle, share: float) -> Recording:
    last = edges_of(recording, circle)[1] + (share - 0.5) * circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    return _rows(recording, recording.t_s <= last)


def _rows(recording: Recording, rows: np.ndarray) -> Recording:
    t_s = recording.t_s[rows]
    return replace(recording, t_s=t_s - t_s[0], length_mm=recording.length_mm[rows])


def clock_set(recording: Recording, circle: Circle, seconds: float) -> Recording:
    """The computer's clock is set half-way round: times behind it are later by so much, no reading is lost."""
    return replace(recording, t_s=recording.t_s + np.where(progress(recording, circle) >= 180.0, seconds, 0.0))


def silent(recording: Recording, circle: Circle, seconds: float) -> Recording:
    since_s = (progress(recording, circle) - 180.0) / circle.turning_deg_s
    return _rows(recording, (since_s < 0.0) | (since_s > seconds))


def clock_fast(recording: Recording, _circle: Circle, percent: float) -> Recording:
    return replace(recording, t_s=recording.t_s * (1.0 + 0.01 * percent))


def in_blocks(recording: Recording, _circle: Circle, seconds: float) -> Recording:
    step_s = float(np.median(np.diff(recording.t_s)))
    block = max(round(seconds / step_s), 1)
    number = np.arange(len(recording)) % block
    return replace(recording, t_s=recording.t_s + (block - 1 - number) * (step_s - 1e-5))


def shaken(recording: Recording, circle: Circle, um: float) -> Recording:
    since_s = (progress(recording, circle) - 90.0) / circle.turning_deg_s
    noise = np.random.default_rng(3).normal(0.0, um, len(recording))
    return longer(recording, np.where((since_s > 0.0) & (since_s < 3.0), noise, 0.0))


def loose(recording: Recording, circle: Circle, um: float) -> Recording:
    """A loose holder tips to either side of its seat, with the pull of the bar."""
    theta = np.radians(circle.theta_deg(progress(recording, circle)) - 70.0)
    return longer(recording, um * np.sign(np.cos(theta)))


def longer_bar(recording: Recording, _circle: Circle, um: float) -> Recording:
    return longer(recording, np.full(len(recording), um))


def stuck_with_noise(recording: Recording, circle: Circle, seconds: float) -> Recording:
    since_s = (progress(recording, circle) - 140.0) / circle.turning_deg_s
    inside = (since_s >= 0.0) & (since_s <= seconds)
    slow = _slow(recording)
    length = recording.length_mm.copy()
    length[inside] += slow[inside][0] - slow[inside]
    return replace(recording, length_mm=length)


def _slow(recording: Recording, seconds: float = 0.5) -> np.ndarray:
    width = max(round(seconds / float(np.median(np.diff(recording.t_s)))), 1)
    padded = np.pad(recording.length_mm, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def averaged(recording: Recording, _circle: Circle, seconds: float) -> Recording:
    share = 1.0 - np.exp(-float(np.median(np.diff(recording.t_s))) / seconds)
    length = recording.length_mm.copy()
    for k in range(1, len(length)):
        length[k] = length[k - 1] + share * (recording.length_mm[k] - length[k - 1])
    return replace(recording, length_mm=length)


def coarse(recording: Recording, _circle: Circle, um: float) -> Recording:
    return replace(recording, length_mm=1e-3 * um * np.round(1e3 * recording.length_mm / um))


def shorter_overlap(recording: Recording, circle: Circle, degrees: float) -> Recording:
    phi = progress(recording, circle)
    cut_deg = circle.overshoot_deg
    begin = (phi > -cut_deg + 3.0) & (phi < -cut_deg + 3.0 + degrees)
    end = (phi > 357.0 + cut_deg - degrees) & (phi < 357.0 + cut_deg)
    rows = ~(begin | end)
    step_s = float(np.median(np.diff(recording.t_s)))
    return replace(recording, t_s=step_s * np.arange(int(rows.sum())), length_mm=recording.length_mm[rows])


def lifted_over_a_sector(recording: Recording, circle: Circle, um: float) -> Recording:
    """Dirt in the cup lifts the bar over a quarter of the turn: a step up, and as much down."""
    phi = progress(recording, circle)
    return longer(recording, np.where((phi > 120.0) & (phi < 210.0), um, 0.0))


def slipped_and_back(recording: Recording, circle: Circle, um: float) -> Recording:
    """A cup slips in five steps, and the last one takes it back: no closure, no drift."""
    steps = np.searchsorted([50.0, 110.0, 170.0, 230.0, 290.0], progress(recording, circle))
    return longer(recording, um * np.array([0.0, 0.4, 0.7, 1.0, 0.6, 0.0])[steps])


def contact(recording: Recording, _circle: Circle, um: float) -> Recording:
    """A loose contact: one reading of a hundred jumps by so much, either way."""
    rng = np.random.default_rng(5)
    jumps = um * rng.choice([-1.0, 1.0], len(recording)) * (rng.random(len(recording)) < 0.01)
    return longer(recording, jumps)


def with_hysteresis(recording: Recording, _circle: Circle, um: float) -> Recording:
    """A gauge with play: it stays behind by half of it, either way the plunger goes."""
    length, half = 1e3 * recording.length_mm, 0.5 * um
    read = np.empty_like(length)
    read[0] = length[0]
    for k in range(1, len(length)):
        read[k] = min(max(read[k - 1], length[k] - half), length[k] + half)
    return replace(recording, length_mm=1e-3 * read)


def lobed(recording: Recording, circle: Circle, um: float) -> Recording:
    theta = np.radians(circle.theta_deg(progress(recording, circle)))
    return longer(recording, um * np.cos(3.0 * theta + 0.7))


def beside_its_axis(recording: Recording, circle: Circle, um: float) -> Recording:
    theta = np.radians(circle.theta_deg(progress(recording, circle)))
    return longer(recording, um * np.cos(theta - 1.0))


def exchanged_times(recording: Recording, _circle: Circle, share: float) -> Recording:
    at = np.flatnonzero(np.random.default_rng(6).random(len(recording) - 1) < share)
    length = recording.length_mm.copy()
    for k in at:
        length[[k, k + 1]] = length[[k + 1, k]]
    return replace(recording, length_mm=length)


def waved(recording: Recording, circle: Circle, um: float) -> Recording:
    """A gauge whose scale has waves of 0.1 mm."""
    return longer(recording, um * np.sin(2.0 * np.pi * (recording.length_mm - circle.bar_mm) / 0.1))


@dataclass(frozen=True)
class Strange:
    """A fault: what it does to a recording, in which sizes, and which runs have it."""

    name: str
    spoiler: Spoiler
    sizes: tuple[float, ...]
    shared: Shared = Shared.RUN


STRANGE = (
    Strange("bar slips half-way [µm]", slipped, (5.0, 20.0)),
    Strange("cup lifts for 0.5 s [µm]", lifted, (5.0, 50.0)),
    Strange("feed lower over 60 degrees [%]", slower_for_a_while, (5.0, 20.0)),
    Strange("mirrored in X", mirror_image, (0.0,)),
    Strange("mirrored in X", mirror_image, (0.0,), Shared.TEST),
    Strange("mirrored in X", mirror_image, (0.0,), Shared.ALL),
    Strange("wrong way round", lambda r, c, _s: mirrored(r, c, 1.0), (0.0,)),
    Strange("wrong way round", lambda r, c, _s: mirrored(r, c, 1.0), (0.0,), Shared.TEST),
    Strange("wrong way round", lambda r, c, _s: mirrored(r, c, 1.0), (0.0,), Shared.ALL),
    Strange("wrong start [deg]", begun_elsewhere, (5.0, 30.0, 180.0)),
    Strange("wrong start [deg]", begun_elsewhere, (30.0, 90.0), Shared.TEST),
    Strange("wrong start [deg]", begun_elsewhere, (90.0,), Shared.ALL),
    Strange("door opens half-way [µm]", warmed_at_once, (5.0, 20.0)),
    Strange("bar warm from the hand [µm]", warm_from_the_hand, (5.0, 20.0)),
    Strange("begun in the feed-in [share]", begun_in_motion, (0.1, 0.3, 0.7)),
    Strange("ended in the feed-out [share]", ended_in_motion, (0.3, 0.7, 0.9)),
    Strange("clock set half-way [s]", clock_set, (0.2, 1.0)),
    Strange("silent half-way [s]", silent, (0.2, 1.0)),
    Strange("clock fast [%]", clock_fast, (0.3, 1.0), Shared.ALL),
    Strange("readings in blocks [s]", in_blocks, (0.1, 0.5), Shared.ALL),
    Strange("shaken for 3 s [µm]", shaken, (1.0, 5.0)),
    Strange("loose holder [µm]", loose, (5.0, 20.0)),
    Strange("loose holder [µm]", loose, (5.0, 20.0), Shared.TEST),
    Strange("other bar [µm]", longer_bar, (10.0, 50.0), Shared.TEST),
    Strange("other bar [µm]", longer_bar, (10.0, 50.0), Shared.ALL),
    Strange("sticks with noise [s]", stuck_with_noise, (2.0, 5.0, 15.0)),
    Strange("display averages [s]", averaged, (0.2, 1.0), Shared.ALL),
    Strange("coarse display [µm]", coarse, (2.0, 10.0), Shared.ALL),
    Strange("shorter overlap [deg]", shorter_overlap, (10.0, 40.0)),
    Strange("cup lifts over a quarter [µm]", lifted_over_a_sector, (3.0, 10.0)),
    Strange("cup lifts over a quarter [µm]", lifted_over_a_sector, (10.0,), Shared.TEST),
    Strange("slips in steps and back [µm]", slipped_and_back, (3.0, 10.0)),
    Strange("loose contact [µm]", contact, (2.0, 5.0)),
    Strange("gauge with play [µm]", with_hysteresis, (2.0, 5.0), Shared.ALL),
    Strange("ball with three lobes [µm]", lobed, (2.0, 10.0), Shared.ALL),
    Strange("ball beside the spindle's axis [µm]", beside_its_axis, (20.0, 100.0), Shared.ALL),
    Strange("readings exchanged [share]", exchanged_times, (0.1, 0.5)),
    Strange("gauge with waves [µm]", waved, (1.0, 5.0), Shared.ALL),
)
COPIED, OTHER_FILE = "file of the run before again", "file of the other direction again"
MOVED = "program and ball at another bore and height"


def moved_plan(plan: Plan) -> Plan:
    """All balls in another bore, and on another holder: programs of another plan, run where its balls stand."""
    others = {ball.name: plan.balls[(k + 3) % len(plan.balls)] for k, ball in enumerate(plan.balls)}

    def elsewhere(ball: Ball) -> Ball:
        other = others[ball.name]
        holder = other.holder if other.holder != ball.holder else ("long" if ball.holder == "short" else "short")
        raised = HOLDER_HEIGHT_MM[holder] - HOLDER_HEIGHT_MM[other.holder]
        x_mm, y_mm, z_mm = other.centre_mm
        return replace(ball, bore=other.bore, holder=holder, centre_mm=(x_mm, y_mm, round(z_mm + raised, 4)))

    return replace(plan, balls=tuple(elsewhere(ball) for ball in plan.balls))


Counted = collections.defaultdict[tuple[str, str, float, When, bool], collections.Counter[Advice]]


def strange(folder: Path, seed: int, only: str = "") -> tuple[Counted, dict[tuple[str, str, float, When, bool], float]]:
    """Judge the second direction of each test with each fault; return the words, and the greatest error of a run that is GOOD [µm rms].

    With `only` those faults whose name and runs match this expression.
    """
    words: Counted = collections.defaultdict(collections.Counter)
    harm: dict[tuple[str, str, float, When, bool], float] = {}
    modelled = calibrated(folder, seed)
    if not only:
        sound(folder / "moved", seed, TESTS, planned=moved_plan(subset(table_ii_plan(seed), list(TESTS))))
    moved = {} if only else {one.run.label: one.run.recording for one in read(folder / "moved").runs}
    for with_model in (False, True):
        whole = modelled if with_model else read(folder / "spoilt")
        seconds = [one for n, one in enumerate(o for o in whole.runs if o.run.repeat == 1) if n % 2 == 1]
        for one in seconds:
            for when in (When.FIRST, When.LATER):
                known = before(whole, one, when)

                def note(name: str, shared: str, size: float, spoilt: Seen, beside: list[Seen]) -> None:
                    judged = SessionRuns([*beside, spoilt]).judge(spoilt)
                    word = answer(judged.findings, spoilt.problem).word
                    key = (name, shared, size, when, with_model)  # noqa: B023 - called in this round
                    words[key][word] += 1
                    if word is not Advice.REPEAT:
                        off = float(np.linalg.norm(spoilt.local_um - one.local_um))  # noqa: B023
                        harm[key] = max(harm.get(key, 0.0), off)
                        sys.stderr.write(f"{key} {spoilt.run.label} {word} {off:.1f} µm\n")

                for fault in (each for each in STRANGE if re.search(only, f"{each.name}, {each.shared}")):
                    for size in fault.sizes:
                        spoilt = _spoilt(one, fault.spoiler, size)
                        beside = [_spoilt(o, fault.spoiler, size) if _has(fault, o, one) else o for o in known]
                        note(fault.name, fault.shared, size, spoilt, beside)
                if only:
                    continue
                opposite = next(o for o in known if o.run.test == one.run.test)
                again = replace(one, run=replace(one.run, repeat=2, recording=replace(one.run.recording, name="again")))
                note(COPIED, Shared.RUN, 0.0, again, [*known, one])
                note(OTHER_FILE, Shared.RUN, 0.0, _with(one, opposite.run.recording), known)
                note(MOVED, Shared.RUN, 0.0, _with(one, moved[one.run.label]), known)
                both = [_with(o, moved[o.run.label]) if o.run.test == one.run.test else o for o in known]
                note(MOVED, Shared.TEST, 0.0, _with(one, moved[one.run.label]), both)
    return words, harm


def _has(fault: Strange, other: Seen, one: Seen) -> bool:
    return fault.shared is Shared.ALL or (fault.shared is Shared.TEST and other.run.test == one.run.test)


def _spoilt(one: Seen, spoiler: Spoiler, size: float) -> Seen:
    return _with(one, spoiler(one.run.recording, one.run.circle, size))


def _with(one: Seen, recording: Recording) -> Seen:
    return seen(replace(one.run, recording=recording))


def print_later(folder: Path, seed: int, only: str = "") -> None:
    """The same in short: behind the first runs of all other tests, without a model."""
    first = [one for one in sound(folder, seed, TESTS).runs if one.run.repeat == 1]
    for fault in (each for each in STRANGE if re.search(only, f"{each.name}, {each.shared}")):
        for size in fault.sizes:
            faulty = {id(one): _spoilt(one, fault.spoiler, size) for one in first}
            words: collections.Counter[Advice] = collections.Counter()
            worst = 0.0
            for one in first[1::2]:
                spoilt = faulty[id(one)]
                has = [other is one or _has(fault, other, one) for other in first]
                runs = [faulty[id(other)] if had else other for other, had in zip(first, has, strict=True)]
                word = answer(SessionRuns(runs).judge(spoilt).findings, spoilt.problem).word
                words[word] += 1
                if word is not Advice.REPEAT:
                    worst = max(worst, float(np.linalg.norm(spoilt.local_um - one.local_um)))
            cells = "/".join(str(words[word]) for word in (Advice.GOOD, Advice.CANNOT_TELL, Advice.REPEAT))
            sys.stdout.write(f"| {fault.name} | {fault.shared} | {size:g} | {cells} | {worst:.1f} |\n")


def print_strange(folder: Path, seed: int, only: str = "") -> None:
    """The table of docs/validation.md: GOOD, CANNOT TELL and REPEAT of each fault."""
    words, harm = strange(folder, seed, only)
    heads = [(when, with_model) for with_model in (False, True) for when in (When.FIRST, When.LATER)]
    titles = [f"{when}{', model' if with_model else ''}" for when, with_model in heads]
    sys.stdout.write(f"| fault | in | size | {' | '.join(titles)} | error [µm rms] |\n|{' --- |' * (len(heads) + 4)}\n")
    for name, shared, size in dict.fromkeys(key[:3] for key in words):
        keys = [(name, shared, size, *head) for head in heads]
        cells = [
            "/".join(str(words[key][word]) for word in (Advice.GOOD, Advice.CANNOT_TELL, Advice.REPEAT)) for key in keys
        ]
        worst = max((harm[key] for key in keys if key in harm), default=0.0)
        shown = f"{size:g}" if size else ""
        left = f"{worst:.1f}" if worst else ""
        sys.stdout.write(f"| {name} | {shared} | {shown} | {' | '.join(cells)} | {left} |\n")
