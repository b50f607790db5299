"""Three levels of circles: sizes, classes and places against effects that were put in, and against refits written out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

from dbbstation.diagnosis.diagnose import thinned, without_doubtful, without_tests
from dbbstation.diagnosis.explain import explain
from dbbstation.diagnosis.verdicts import CircleJudge, circle_levels, outcome_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.folds import chosen_anew, in_turn
from dbbstation.inference.followed import VariableProbabilities, classes_of, follow_of
from dbbstation.inference.levels import Differs, FollowsAnswer, Verdict
from dbbstation.inference.levels_of import form_probabilities
from dbbstation.results.levels_text import short_sentences
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

FEW = ("backlash", "gravity", "strut-weight", "screw-cyclic", "bar-drift", "jig-bump")
STRUT_3_UM = 12.0


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Play in one strut, and gravity, which the geometry takes up for the most part."""
    folder = tmp_path_factory.mktemp("levels")
    plan = subset(table_ii_plan(51), EIGHT)
    hidden = [Backlash((0.0, 0.0, STRUT_3_UM, 0.0, 0.0, 0.0)), Gravity()]
    kinematics = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
    record(folder / "s", seed=51, plan=plan, mechanisms=[kinematics, *hidden], rate_hz=3.0)
    recorded = load_sessions([folder / "s"])
    runs = [thinned(one) for one in recorded.observations]
    explained = without_doubtful(explain(recorded.machine, runs, sources_named(FEW), lambda _: None))
    outcome = outcome_of(explained)
    gains = without_tests(explained, outcome)
    return explained, outcome, gains, circle_levels(explained, outcome, gains)


@pytest.mark.slow
def test_it_differs_and_follows_what_was_put_in(both):
    _, _, _, levels = both
    assert levels.differs.answer is Differs.YES
    by_name = {one.name: one for one in levels.follows}
    play = next(one for one in levels.follows if "backlash" in one.members)
    assert play.answer is FollowsAnswer.FOLLOWS
    assert play.where == "strut 3"
    assert play.after < play.before
    weight = by_name["strut-force"]
    assert weight.form.name == "gravity"
    assert weight.or_variables == ()
    assert levels.correction


@pytest.mark.slow
def test_classes_are_left_out_together(both):
    """What each class brings is the evidence of all tests less that of the others, with it less without, all of one group."""
    explained, outcome, gains, _ = both
    classes = classes_of(outcome, VariableProbabilities(outcome))
    out, noise = gains.rows[0], outcome.noise.sigma
    channel = explained.channel
    target = outcome.bank.target
    whole = channel.beside_base(noise).comparison(target)
    others = channel.beside_base(noise, but_for=out).comparison(np.where(out, 0.0, target))
    best = outcome.best.members
    wanted = [one.wanted for one in classes]
    (found,) = chosen_anew(
        whole, [others], lambda _: best, lambda name: (name,), classes=wanted, follow=follow_of(outcome)
    )
    for one in classes:
        less = [m for m in best if m.cause.name not in one.members]
        brought = (whole.log_evidence(best) - others.log_evidence(best)) - (
            whole.log_evidence(less) - others.log_evidence(less)
        )
        assert found[one.wanted] == pytest.approx(brought, abs=1e-6)


@pytest.mark.slow
def test_tests_that_are_held_out_give_no_cause_its_size(both):
    """Errors of each fifth of the tests, written out: kept tests give geometry and causes, a test its own ball and bar only."""
    explained, _, gains, _ = both
    channel, settled = explained.channel, explained.settled
    members = [member for member in settled.best.members if not member.cause.setup]
    base, known, target = channel.columns.base, channel.base, channel.target(settled.after)
    machine = (base * known.scale)[:, ~known.random] @ null_space(channel.held)
    setup = base[:, known.random] * known.prior[known.random]
    causes = [channel.columns.of(member.variant.columns) * member.variant.plausible for member in members]
    columns = np.hstack([setup, *causes, machine])
    groups = in_turn([one.test for one in channel.observations], BOUNDS.folds_of_an_error)
    group = np.repeat(groups, [rows.stop - rows.start for rows in channel.runs])

    def fitted(rows, count, goal):
        """Least squares of the first columns; all but those of the machine have a prior of size one."""
        prior = settled.noise_mm * np.eye(columns.shape[1] - machine.shape[1], count)[:count]
        goal = np.concatenate([goal, np.zeros(len(prior))])
        return np.linalg.lstsq(np.vstack([columns[rows, :count], prior]), goal, rcond=1e-14)[0]

    left = np.empty_like(target)
    for one in range(max(groups) + 1):
        out = group == one
        found = fitted(~out, columns.shape[1], target[~out])
        found[: setup.shape[1]] = 0.0
        left[out] = target[out] - columns[out] @ found
        left[out] -= setup[out] @ fitted(out, setup.shape[1], left[out])
    assert gains.of(None).after == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-4)


@pytest.mark.slow
def test_sizes_are_of_the_whole_effect_with_the_part_that_the_geometry_takes_up(both):
    explained, outcome, _, levels = both
    (weight,) = (one for one in levels.differs.detectable if one.follows == "strut-weight")
    cause = next(one for one in outcome.causes if one.name == "strut-weight")
    effect = outcome.bank.samples(cause.variants[0].columns).sum(axis=1)
    machine = explained.channel.columns.base
    known = explained.channel.base
    # The same by a least-squares fit of the base with one more row for the prior of each set-up effect.
    rows = np.vstack([machine, np.diag(outcome.noise.sigma / known.prior)[known.random]])
    scaled = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    left = np.concatenate([effect, np.zeros(known.random.sum())])
    left -= scaled @ np.linalg.lstsq(scaled, left, rcond=1e-9)[0]
    assert weight.concealed == pytest.approx(1.0 - left @ left / (effect @ effect), abs=0.01)
    assert weight.confirm


@pytest.mark.slow
def test_the_probability_of_a_strut_is_that_of_its_forms(both):
    _, outcome, _, _ = both
    found = form_probabilities(outcome, "backlash")
    assert sum(found.values()) == pytest.approx(1.0)
    others, cause = outcome.best.without("backlash"), next(c for c in outcome.causes if c.name == "backlash")
    one = next(v for v in cause.variants if v.label == "strut 3")
    assert found["strut 3"] > 0.95
    assert len(one.columns) == 1
    assert outcome.comparison.scan(others, [cause]).best[0].variant.label == "strut 3"


@pytest.mark.slow
def test_verdicts_are_read_off_the_levels(both):
    explained, outcome, gains, levels = both
    found = {one.name: one for one in CircleJudge(explained, outcome, gains, levels).findings()}
    assert found["backlash"].verdict is Verdict.IDENTIFIED
    assert found["gravity"].verdict is Verdict.IDENTIFIED
    assert all(found[name].verdict.rank > Verdict.AMBIGUOUS.rank for name in FEW if name not in {"gravity", "backlash"})


@pytest.mark.slow
def test_two_sentences_say_that_it_differs_and_what_it_follows_most(both):
    *_, levels = both
    first, second = short_sentences(levels, "µm", "Measured circles and the kinematic model")
    assert first.startswith("Measured circles and the kinematic model differ: probability 1.000")
    largest = max(levels.follows, key=lambda one: one.rms)
    assert second.startswith(f"The difference follows {largest.name}")
    assert f"leaves {largest.after:.3g} of" in second
