"""What all runs of a session have in common: on machines of the plant whose recordings are mirrored and turned, and by a dense covariance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from dbbstation.plan.plan import Circle, Direction
from dbbstation.quality.all_runs import BAR_UM, WAYS, bar_of_all, programs_of_all
from dbbstation.quality.answer import Advice, answer
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.forms import SIZES
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Seen
from dbbstation.trace.expected import COEFFICIENTS, Expected
from dbbstation.trace.recording import Recording
from tests.quality.sessions import Sound, finding_of, sound, spoilt
from tests.quality.spoilers import elsewhere, larger, mirrored, turned
from tests.quality.strange import mirror_image

Spoiler = Callable[..., Recording]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    return sound(tmp_path_factory.mktemp("all") / "session", 1001, "abdh", rate_hz=20.0)


def first_pairs(whole: Sound) -> list[Seen]:
    return [one for one in whole.runs if one.run.repeat == 1]


def quarter(recording: Recording, circle: Circle) -> Recording:
    """Axes turned by 90 degrees: either direction begins where the circle is that much further on towards +Y."""
    return turned(recording, circle, lambda phi: phi + 90.0 * circle.direction.sign)


@pytest.mark.parametrize(
    ("spoiler", "sizes", "ran"),
    [
        (mirrored, (1.0,), "the wrong way round"),
        (mirror_image, (0.0,), "mirrored in X"),
        (quarter, (), "in axes turned by 90 degrees"),
    ],
)
def test_programs_that_all_ran_otherwise_are_told_and_how(
    whole: Sound, spoiler: Spoiler, sizes: Sequence[float], ran: str
) -> None:
    runs = [spoilt(one, spoiler, *sizes) for one in first_pairs(whole)]
    judged = SessionRuns(runs).judge(runs[-1])
    one = finding_of(judged, Name.PROGRAMS)
    assert one is not None
    assert one.verdict is FindingVerdict.WRONG, one
    assert ran in one.short
    assert answer(judged.findings).causes[0].startswith("all programs ran ")


def test_ways_are_the_turns_and_mirror_images_of_a_square() -> None:
    """A circle begins where the matrix of the way takes its start, and the sign of the determinant tells its sense."""
    x, y = np.eye(2)
    matrices = {
        "mirrored in X": [-x, y],
        "mirrored in Y": [x, -y],
        "with X and Y exchanged": [y, x],
        "with X and -Y exchanged": [-y, -x],
        "in axes turned by 90 degrees": [-y, x],
        "in axes turned by 180 degrees": [-x, -y],
        "in axes turned by 270 degrees": [y, -x],
    }
    same_place, *ways = WAYS
    assert same_place.reverses
    assert [way.label for way in ways] == list(matrices)
    for way, matrix in zip(ways, matrices.values(), strict=True):
        start, begin = np.radians(20.0), np.radians(way.begin_deg(20.0))
        there = np.array(matrix) @ [np.cos(start), np.sin(start)]
        assert there == pytest.approx([np.cos(begin), np.sin(begin)])
        assert way.reverses is bool(np.linalg.det(matrix) < 0.0)


def test_sound_runs_are_likelier_as_planned_and_one_that_is_wrong_says_nothing_of_the_others(whole: Sound) -> None:
    runs = first_pairs(whole)
    assert programs_of_all(runs).verdict is FindingVerdict.GOOD
    assert bar_of_all(runs, by_model=False).verdict is FindingVerdict.GOOD
    for spoiler, size in ((mirrored, 1.0), (elsewhere, 500.0), (larger, 500.0)):
        among = [*runs[:3], spoilt(runs[3], spoiler, size), *runs[4:]]
        assert programs_of_all(among).verdict is not FindingVerdict.WRONG
        assert bar_of_all(among, by_model=True).verdict is not FindingVerdict.WRONG


def test_one_test_tells_nothing_of_all_programs(whole: Sound) -> None:
    pair = first_pairs(whole)[:2]
    assert programs_of_all(pair).value is None
    assert bar_of_all(pair, by_model=False).value is None


def test_another_bar_in_all_runs_is_asked_about_and_wrong_where_a_model_knows_the_machine(whole: Sound) -> None:
    runs = [spoilt(one, larger, 50.0) for one in first_pairs(whole)]
    judged = SessionRuns(runs).judge(runs[-1])
    word = answer(judged.findings)
    assert word.word is Advice.CANNOT_TELL
    assert len(word.unseen) == 1
    assert "bar is as long as stated" in word.unseen[0]
    by_model = bar_of_all(runs, by_model=True)
    assert by_model.verdict is FindingVerdict.WRONG
    nobody_knows = [replace(one, run=replace(one.run, bar_stated=False)) for one in runs]
    assert bar_of_all(nobody_knows, by_model=True).value is None
    # Known to some micrometres: a machine's usual errors change all circles by tens of them.
    assert float(by_model.short.split()[3]) == pytest.approx(50.0, abs=15.0)


def test_how_much_likelier_another_bar_is_follows_from_the_dense_covariance() -> None:
    rng = np.random.default_rng(8)
    effects = rng.normal(0.0, 20.0, (2, COEFFICIENTS, 4))[[0, 0, 1, 1]]  # two repeats of two tests
    seats = {test: rng.normal(0.0, 5.0, (COEFFICIENTS, 2)) for test in "ab"}
    circle = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0.0, 45, 1.5, 0, Direction.CCW)
    runs, off = [], []
    for test, effect in zip("aabb", effects, strict=True):
        known = {("machine", ""): effect, ("ball", test): seats[test]}
        expected = Expected(np.zeros(2), 0.0, np.eye(3), effects_um=known)
        run = SimpleNamespace(
            test=test, mounting=test, circle=circle, expected=expected, started_s=None, bar_stated=True
        )
        form = rng.normal(0.0, 1.0, COEFFICIENTS) + 300.0 * np.eye(COEFFICIENTS)[0]
        runs.append(SimpleNamespace(run=run, coefficients_um=form, u_um=1.0, drift_um_s=0.0))
        off.append(form)
    machine, column = np.vstack(list(effects)), np.tile(np.eye(COEFFICIENTS)[0], 4)
    seated = block_diag(*(np.vstack([seats[test]] * 2) for test in "ab"))
    with_bar, without = [], []
    for size in SIZES:
        # Noise of each run is half of what two runs of it differ by.
        covariance = size**2 * machine @ machine.T + seated @ seated.T + np.eye(len(column))
        without.append(multivariate_normal.logpdf(np.concatenate(off), cov=covariance))
        covariance += BAR_UM**2 * np.outer(column, column)
        with_bar.append(multivariate_normal.logpdf(np.concatenate(off), cov=covariance))
    found = bar_of_all(runs, by_model=True)  # type: ignore[arg-type]  # what is asked of runs is there
    assert found.value == pytest.approx(logsumexp(with_bar) - logsumexp(without), rel=1e-6)
