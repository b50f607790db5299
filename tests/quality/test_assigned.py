"""Which circle of the plan each run shows, on the fifteen-minute sitting of a virtual machine of known errors."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import SessionDetails
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.judged import circles_of_plan
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.quality.assigned import WIDE, Assigned, FormerSitting, Known, effects_of
from dbbstation.quality.beside import SIZES, mean_of
from dbbstation.quality.finding import FindingVerdict, Name, undecided
from dbbstation.quality.knowledge import Run, seen
from dbbstation.quality.plan_effects import BESIDE, ELSEWHERE, ELSEWHERE_UM, LARGER
from dbbstation.quality.together import read_um
from dbbstation.trace.recording import Recording
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.station.bench import MACHINE_FILE

if TYPE_CHECKING:
    from dbbstation.quality.knowledge import Planned, Seen

CCW, CW = Direction.CCW, Direction.CW
TESTS = ("low", "side", "high")
PLANNED = [(test, way) for test in TESTS for way in (CCW, CW)]


@pytest.fixture(scope="module")
def sitting(tmp_path_factory: pytest.TempPathFactory) -> tuple[tuple[Planned, ...], dict[tuple[str, Direction], Seen]]:
    machine = read_machine(MACHINE_FILE)
    plan = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    with SessionWriter.create(tmp_path_factory.mktemp("s") / "session", machine, plan, SessionDetails()) as writer:
        circles = circles_of_plan(writer.session, None)
    return circles, measured(circles, 5)


def measured(circles: tuple[Planned, ...], seed: int | None) -> dict[tuple[str, Direction], Seen]:
    """Return every circle of a random machine, or of one without errors."""
    machine = read_machine(MACHINE_FILE)
    plan = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    errors = () if seed is None else random_kinematics(machine, seed)
    virtual = VirtualMachine(MachineModel(machine, errors), plan.to_domain(), seed=seed or 5)
    runs = {}
    for circle in circles:
        made = virtual.run(circle.test, circle.circle.direction)
        t_s = np.arange(0.0, made.path.duration_s, 0.05)
        lengths = np.array([made.length_mm_at(t) + virtual.noise_mm() for t in t_s.tolist()])
        recording = Recording(circle.test, t_s, lengths)
        runs[circle.test, circle.circle.direction] = seen(
            Run(circle.test, 1, circle.test, circle.circle, recording, expected=circle.expected)
        )
    return runs


def shown(sitting: object, instead: dict[tuple[str, Direction], tuple[str, Direction]], count: int = 6) -> Assigned:
    """The first runs of a sitting, some of which show another circle: the reading along the travel is the other's."""
    circles, runs = sitting
    made = []
    for asked in PLANNED[:count]:
        other = runs[instead.get(asked, asked)]
        sign = runs[asked].run.circle.direction.sign * other.run.circle.direction.sign
        signs = np.array([1, 1, 1, 1, sign, sign, sign])
        made.append(replace(runs[asked], coefficients_um=signs * other.coefficients_um))
    return Assigned(effects_of(circles), made)


def suspected(assigned: Assigned) -> dict[str, str]:
    return {one.run.label: finding.short for one, finding in assigned.suspects().items()}


def test_a_sound_sitting_has_no_suspect_and_decides_every_circle(sitting) -> None:
    for count in range(1, 7):
        assert suspected(shown(sitting, {}, count)) == {}
    assigned = shown(sitting, {})
    for last in range(6):
        # The circle of the last run is asked about.
        runs = [*assigned.runs[:last], *assigned.runs[last + 1 :], assigned.runs[last]]
        for name in (Name.TEST, Name.DIRECTION):
            found = Assigned(assigned.effects, runs).finding(runs[-1], undecided(name, ""))
            assert found.verdict is FindingVerdict.GOOD


def test_a_machine_without_errors_has_no_suspect(sitting) -> None:
    circles, _ = sitting
    for count in (2, 4, 6):
        assert suspected(shown((circles, measured(circles, None)), {}, count)) == {}


def test_the_first_circle_alone_decides_nothing_and_a_session_before_decides_it(sitting) -> None:
    circles, runs = sitting
    alone = shown(sitting, {}, 1)
    assert alone.finding(alone.runs[0], undecided(Name.TEST, "")).verdict is FindingVerdict.CANNOT_TELL
    assert alone.since(alone.runs[0]) is None
    read = {(test, str(way)): read_um(one) for (test, way), one in runs.items()}
    before = FormerSitting("monday", date(2026, 5, 12), read)
    known = Assigned(effects_of(circles, before), alone.runs, before)
    assert known.finding(known.runs[0], undecided(Name.TEST, "")).verdict is FindingVerdict.GOOD
    since = known.since(known.runs[0])
    assert since.verdict is FindingVerdict.GOOD
    # The machine was put together anew since: said, and no circle is suspected for it.
    other = {(test, str(way)): read_um(one) for (test, way), one in measured(circles, 6).items()}
    former = FormerSitting("monday", date(2026, 5, 12), other)
    changed = Assigned(effects_of(circles, former), list(runs.values()), former)
    assert suspected(changed) == {}
    since = changed.since(changed.runs[0])
    assert since.verdict is FindingVerdict.CANNOT_TELL
    assert "changed since 12 May" in since.text
    # The program of another test is known at once.
    wrong = Assigned(effects_of(circles, before), shown(sitting, {PLANNED[0]: ("high", CCW)}, 1).runs, before)
    assert suspected(wrong) == {"low ccw 1": "it is the circle of high ccw"}


def test_a_machine_that_was_corrected_since_the_session_before_has_no_suspect(sitting) -> None:
    """Circles without errors are alike: all would be one circle, if the session before were all that is known."""
    circles, runs = sitting
    read = {(test, str(way)): read_um(one) for (test, way), one in runs.items()}
    former = FormerSitting("monday", date(2026, 5, 12), read)
    corrected, effects, before = list(measured(circles, None).values()), effects_of(circles, former), None
    for count in range(1, 7):
        before = Assigned(effects, corrected[:count], former, before)
        assert suspected(before) == {}
    assert suspected(Assigned(effects[1:], corrected, former))


def test_two_tests_that_changed_places_are_found_behind_the_third(sitting) -> None:
    swapped = {(one, way): (other, way) for one, other in (("low", "side"), ("side", "low")) for way in (CCW, CW)}
    found = suspected(shown(sitting, swapped, 5))
    assert found == {
        "low ccw 1": "it is the circle of side ccw",
        "low cw 1": "it is the circle of side cw",
        "side ccw 1": "it is the circle of low ccw",
        "side cw 1": "it is the circle of low cw",
    }


@pytest.mark.parametrize("asked", [("low", CCW), ("low", CW), ("high", CW)])
def test_a_circle_the_wrong_way_round_is_found_in_the_end(sitting, asked: tuple[str, Direction]) -> None:
    test, way = asked
    found = suspected(shown(sitting, {asked: (test, CW if way is CCW else CCW)}))
    label = f"{test} {way} 1"
    assert "it ran the wrong way round" in found[label]
    # One of both directions is wrong; where the others cannot say which, both are named.
    assert set(found) <= {label, f"{test} {CW if way is CCW else CCW} 1"}


@pytest.mark.parametrize(
    "instead",
    [
        {},
        {("low", CCW): ("low", CW)},
        {(one, way): (other, way) for one, other in (("low", "side"), ("side", "low")) for way in (CCW, CW)},
        {("side", way): ("high", way) for way in (CCW, CW)},
    ],
)
def test_answers_are_those_of_all_assignments_written_out(sitting, instead) -> None:
    """The likeliest are scored first; a search that scores every one, by the whole covariance, answers alike."""
    for count in range(1, 5):
        assigned = shown(sitting, instead, count)
        written = shown(sitting, instead, count)
        written.__dict__["_looked_up"] = known = Known(count)
        for changes, log in every_score(written).items():
            known.add(changes, log, written.compared[0])
        assert suspected(assigned) == suspected(written)
        one = assigned.runs[-1]
        for name in (Name.TEST, Name.DIRECTION):
            found, wanted = (each.finding(each.runs[-1], undecided(name, "")) for each in (assigned, written))
            assert (found.verdict, found.text) == (wanted.verdict, wanted.text)
        for one, finding in written.suspects().items():
            (other,) = (f for o, f in assigned.suspects().items() if o.run.label == one.run.label)
            assert other.value == pytest.approx(finding.value, rel=1e-6, abs=1e-2)


def every_score(assigned: Assigned) -> dict[tuple[tuple[int, int], ...], float]:
    """Log densities with mistakes of all assignments beside the best three, and beside those that they lead to."""
    known = {(): log_density(assigned, assigned._labels(()))}
    followed: set[tuple[tuple[int, int], ...]] = set()
    while True:
        ranked = sorted(known, key=known.__getitem__, reverse=True)[:WIDE]
        best = [each for each in ranked if known[each] >= known[()] - assigned.cost and each not in followed]
        if not best:
            return known
        for base in best:
            followed.add(base)
            for runs, others in assigned._all_changes():
                for other in others:
                    changes = assigned._with(base, runs, other)
                    if changes not in known:
                        log = log_density(assigned, assigned._labels(changes))
                        known[changes] = log - assigned._mistakes(changes)


def test_the_cholesky_score_is_the_normal_density(sitting) -> None:
    """Against the density of all readings under the whole covariance, one size at a time."""
    assigned = shown(sitting, {}, 4)
    labels = tuple(assigned.planned)
    circles = [assigned.circles[k] for k in labels]
    logs = []
    from scipy.special import logsumexp  # noqa: PLC0415
    from scipy.stats import multivariate_normal  # noqa: PLC0415

    machine = np.vstack([assigned.effects[0].of_machine[k] for k in labels])
    session = np.vstack([assigned.effects[0].of_session[k] for k in labels])
    off = np.concatenate([read_um(one) - read_um_expected(c) for one, c in zip(assigned.runs, circles, strict=True)])
    for size in SIZES:
        whole = size**2 * machine @ machine.T + session @ session.T
        for k, one in enumerate(assigned.runs):
            rows = slice(7 * k, 7 * k + 7)
            whole[rows, rows] += assigned.effects[0].own[labels[k]] + one.u_um**2 * np.eye(7)
        logs.append(multivariate_normal(np.zeros(len(off)), whole, allow_singular=True).logpdf(off))
    wanted = logsumexp(logs) - np.log(len(SIZES)) + 0.5 * len(off) * np.log(2.0 * np.pi)
    assert assigned._looked_up.planned == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_bounds_from_before_a_run_change_no_decision(sitting, seed: int) -> None:
    """A sitting in which circles are exchanged at random grows run by run; every decision is taken anew beside it."""
    rng = np.random.default_rng(seed)
    instead = {}
    for one, other in rng.choice(6, (2, 2), replace=False):
        instead |= {PLANNED[one]: PLANNED[other]} | ({PLANNED[other]: PLANNED[one]} if seed % 2 else {})
    whole, before, spared = shown(sitting, instead), None, 0
    for count in range(1, 7):
        anew = Assigned(whole.effects, whole.runs[:count])
        before = Assigned(whole.effects, whole.runs[:count], before=before)
        assert before.suspects() == anew.suspects()
        for name in (Name.TEST, Name.DIRECTION):
            found, wanted = (one.finding(whole.runs[count - 1], undecided(name, "")) for one in (before, anew))
            assert found == wanted
        known = [
            before.compared[0].most(base, runs, labels.shape[1])
            for base in before.compared[0].bounds
            for runs, labels in before._changes
        ]
        spared += sum(int(np.isfinite(each).sum()) for each in known)
    assert spared


def test_all_labels_at_once_score_as_each_under_the_whole_covariance(sitting) -> None:
    """Every assignment beside two, among them swaps and runs of no circle, against the density of all readings."""
    for given in ((), ((0, 2),)):
        assigned = shown(sitting, {}, 4)
        labels = assigned._labels(given)
        beside = assigned.compared[0].near(labels)
        assert beside.log == pytest.approx(log_density(assigned, labels), rel=1e-7, abs=1e-3)
        widths = set()
        for runs, instead in assigned._changes:
            most = beside.most(runs, instead, -np.inf)
            places = np.nonzero(np.ones(instead.shape[:2]))
            logs = beside.changed(runs[places[0]], instead[places], most[:, *places], np.full(len(places[0]), -np.inf))
            for at, other, log, bound in zip(*places, logs, mean_of(most)[places], strict=True):
                changes = assigned._with(given, runs[at].tolist(), instead[at, other].tolist())
                assert log == pytest.approx(log_density(assigned, assigned._labels(changes)), rel=1e-7, abs=1e-3)
                assert bound >= log - 1e-6
                widths.add((runs.shape[1], *{-1, -2, -3} & {label for _, label in changes}))
        assert {one[0] for one in widths} >= {1, 2, 4}
        assert {ELSEWHERE, BESIDE, LARGER} <= {label for one in widths for label in one[1:]}


def log_density(assigned: Assigned, labels: tuple[int, ...]) -> float:
    """Log density of all readings with all covariances written out."""
    count = len(assigned.runs)
    machine = np.zeros((count, 7, assigned.effects[0].of_machine.shape[2]))
    session = np.zeros((count, 7, assigned.effects[0].of_session.shape[2]))
    own, off = np.zeros((7 * count, 7 * count)), np.zeros((count, 7))
    for k, (one, label) in enumerate(zip(assigned.runs, labels, strict=True)):
        circle = assigned.planned[k] if label < 0 else label
        off[k] = read_um(one) - read_um_expected(assigned.circles[circle])
        rows = slice(7 * k, 7 * k + 7)
        own[rows, rows] = ELSEWHERE_UM**2 * np.eye(7)
        if label != ELSEWHERE:
            machine[k], session[k] = assigned.effects[0].of_machine[circle], assigned.effects[0].of_session[circle]
            more = {BESIDE: [0, 1, 0, 0, 1, 0, 0], LARGER: [1, 0, 0, 0, 0, 0, 0]}.get(label, [0] * 7)
            own[rows, rows] = (
                assigned.effects[0].own[circle] + one.u_um**2 * np.eye(7) + ELSEWHERE_UM**2 * np.diag(more)
            )
    machine, session, off = machine.reshape(7 * count, -1), session.reshape(7 * count, -1), off.ravel()
    logs = []
    for size in SIZES:
        whole = own + size**2 * machine @ machine.T + session @ session.T
        logs.append(-0.5 * (off @ np.linalg.solve(whole, off) + np.linalg.slogdet(whole)[1]))
    return float(np.logaddexp.reduce(logs) - np.log(len(SIZES)))


def read_um_expected(circle: Planned) -> np.ndarray:
    signs = np.array([1, 1, 1, 1, *[circle.circle.direction.sign] * 3])
    length = np.array([1e3 * circle.circle.bar_mm, 0, 0, 0, 0, 0, 0])
    return signs * circle.expected.form_um + length
