"""Three levels of answer: sizes that are found by brute force, classes by sums over sets, gains by refits written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import logsumexp

from dbbstation.facts.value import Value
from dbbstation.inference import settle as settling
from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel, Kind, Law, Variable
from dbbstation.inference.folds import Fold, HeldOutError, parts_of
from dbbstation.inference.followed import (
    ChosenWithoutParts,
    VariableProbabilities,
    WithoutPart,
    classes_of,
    followed_by,
    log_density,
    probability_of_any,
)
from dbbstation.inference.hypotheses import SearchWork
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels import (
    TIME,
    DensityGains,
    Detectable,
    DifferenceFound,
    Differs,
    Followed,
    FollowsAnswer,
    LawForm,
    Levels,
    Verdict,
    difference_of,
)
from dbbstation.inference.levels_of import (
    MARGIN,
    POWER,
    detectable,
    detectable_causes,
    law_form,
    least_seen,
    levels_of,
    may_result,
    slow_chance,
)
from dbbstation.inference.model_comparison import LOG_SCALE_WEIGHTS, SCALES
from dbbstation.inference.read_off import CauseJudge, Trial, read_off
from dbbstation.inference.settle import Beginning, settle
from dbbstation.results.levels_text import level_sentences
from tests.inference.tables import direction, table
from tests.inference.test_channel import EFFECTS, channel

ONE = (Beginning.EVERYTHING,)


@pytest.fixture(scope="module")
def both():
    """Hysteresis of one variable and cogging of another, with everything chosen anew without each of ten parts."""
    data = table(2, lambda d: EFFECTS["hysteresis of q"](d) + EFFECTS["twice per turn of angle"](d), rows=600)
    whole = channel(data, blocks=1)
    settled = settle(whole, thorough=False)
    parts = [WithoutPart(rows, settle(whole.without(rows), look=False, beginnings=ONE)) for _, rows in parts_of(whole)]
    return data, settled, parts


@pytest.fixture(scope="module")
def nothing():
    whole = channel(table(3, rows=600), blocks=1)
    return settle(whole, thorough=False)


def test_both_variables_are_followed_each_with_its_law(both):
    _, settled, parts = both
    found = levels_of(settled, left_over(settled), ChosenWithoutParts(parts))
    assert found.differs.answer is Differs.YES
    assert found.differs.gain_without_best > np.log(19.0)
    by_name = {one.name: one for one in found.follows}
    assert {one.answer for one in by_name.values()} == {FollowsAnswer.FOLLOWS}
    assert by_name["q"].form.name == "hysteresis of q"
    assert by_name["angle"].form.name == "twice per turn of angle"
    assert by_name["q"].ways["direction"] > 0.95
    assert by_name["angle"].ways["direction"] < 0.5 < by_name["angle"].ways["value"]


def test_what_a_class_brings_is_what_a_refit_without_it_loses(both):
    """Least squares written out, in the noise of the other rows; sizes of effects have priors, which matter little here."""
    data, settled, parts = both
    q = [direction(data.q)]
    angle = [np.cos(2.0 * np.radians(data.angle)), np.sin(2.0 * np.radians(data.angle))]
    gain = ChosenWithoutParts(parts).of({"q"})
    for part, brought in zip(parts, gain.gains.parts, strict=True):
        sigma = part.settled.noise.innovation
        with_it, without = (squares(data.residual, columns, part.rows) for columns in ([*q, *angle], angle))
        assert brought == pytest.approx(0.5 * (without - with_it) / sigma**2, rel=0.1)
    assert gain.predicts
    assert gain.after < gain.before
    every = ChosenWithoutParts(parts).of(None).gains.total
    assert every > gain.gains.total > 0.0
    assert ChosenWithoutParts(parts).of({"load"}).gains.total == 0.0
    assert settled.best.names == {"hysteresis of q", "twice per turn of angle"}


def squares(residual, columns, rows):
    stacked = np.column_stack([np.ones(len(residual)), *columns])
    values, *_ = np.linalg.lstsq(stacked[~rows], residual[~rows], rcond=None)
    return float(np.sum((residual - stacked @ values)[rows] ** 2))


def test_the_density_of_a_part_is_that_of_white_rows(both):
    _, _, parts = both
    one, rows = parts[3].settled, parts[3].rows
    left = one.channel.residual - one.predicted()
    assert one.noise.is_white
    assert log_density(one, rows, left) == pytest.approx(-0.5 * np.sum(left[rows] ** 2) / one.noise.innovation**2)
    # Of every other row where the noise was measured on every other one.
    thin = replace(one, channel=replace(one.channel, apart=2))
    expected = -0.5 * np.sum(left[rows][::2] ** 2) / one.noise.innovation**2
    assert log_density(thin, rows, left) == pytest.approx(expected)


def test_probabilities_are_sums_over_sets(both):
    _, settled, _ = both
    weights = settled.posterior.weights
    total = logsumexp(list(weights.values()))
    inside = [
        weight for names, weight in weights.items() if any("q" in followed_by(settled.bank, name) for name in names)
    ]
    probabilities = VariableProbabilities(settled)
    assert probabilities.of(["q"]) == pytest.approx(np.exp(logsumexp(inside) - total), abs=1e-6)
    assert probabilities.of(["q", "angle"]) >= probabilities.of(["q"])
    assert probability_of_any(settled) == pytest.approx(1.0)
    assert {one.each for one in classes_of(settled, probabilities)} == {(("q",),), (("angle",),)}


def test_no_effect_is_no_with_the_size_from_which_it_holds(nothing):
    found = levels_of(nothing, left_over(nothing), None)
    assert found.differs.answer is Differs.NO
    assert found.differs.matters == pytest.approx(nothing.channel.size)
    assert not found.follows
    worst = found.differs.detectable[0]
    assert 0.0 < worst.size < found.differs.matters
    strict = levels_of(nothing, left_over(nothing), None, matters=0.1 * worst.size)
    assert strict.differs.answer is Differs.CANNOT_TELL
    assert worst.follows in strict.differs.why
    assert strict.differs.matters_stated


def test_rows_without_an_order_have_no_no(nothing):
    unordered = replace(nothing, channel=replace(nothing.channel, time=None))
    answer = levels_of(unordered, left_over(unordered), None).differs
    assert answer.answer is Differs.CANNOT_TELL
    assert "order" in answer.why


def test_what_the_base_conceals_wholly_has_no_size(nothing):
    cause = next(c for c in nothing.causes if c.name == "curve over load")
    samples = nothing.bank.samples(cause.variants[0].columns)
    base = nothing.channel.base
    wide = replace(
        base,
        names=(*base.names, *(f"p{k}" for k in range(samples.shape[1]))),
        samples=np.hstack([base.samples, samples]),
        prior=np.concatenate([base.prior, np.full(samples.shape[1], np.inf)]),
        random=np.concatenate([base.random, np.zeros(samples.shape[1], dtype=bool)]),
    )
    concealed = settle(replace(nothing.channel, base=wide, static=None), thorough=False, beginnings=ONE)
    sizes = {one.follows: one for one in detectable(concealed)}
    assert sizes["load"] == Detectable("load", None, 1.0)
    assert levels_of(concealed, left_over(concealed), None).differs.answer is Differs.CANNOT_TELL


def test_the_least_size_is_found_in_nine_of_ten_draws(rng):
    """Targets drawn at that size, each scored with the marginal likelihood written out over dense matrices."""
    rows, p, odds = 120, 3, -4.0
    samples = rng.standard_normal((rows, p)) * [1.0, 0.3, 0.1]
    plausible = np.full(p, 2.0)
    size = least_seen(samples.T @ samples, samples, plausible, odds)
    seen = 0
    covariances = [np.eye(rows) + scale**2 * (samples * plausible**2) @ samples.T for scale in SCALES]
    inverses = [np.linalg.inv(one) for one in covariances]
    spreads = [np.linalg.slogdet(one)[1] for one in covariances]
    for _ in range(400):
        effect = samples @ rng.standard_normal(p)
        target = size * effect / np.sqrt(np.mean(effect**2)) + rng.standard_normal(rows)
        factors = [
            0.5 * (target @ target - target @ inverse @ target - spread)
            for inverse, spread in zip(inverses, spreads, strict=True)
        ]
        seen += logsumexp(np.array(factors) + LOG_SCALE_WEIGHTS) + odds >= np.log(19.0)
    # 100 draws know it to 3 %, these to 1.5 %.
    assert seen / 400 == pytest.approx(POWER, abs=0.08)


def test_slow_noise_conceals_nothing_that_the_base_does_not_take(rng):
    """Four whole waves have no mean: an offset takes none of them, whatever the noise; of a constant it takes all."""
    rows = np.arange(800.0)
    slow = lfilter([1.0], [1.0, -0.9], rng.standard_normal(800))
    columns = {"wave": np.sin(2.0 * np.pi * rows / 200.0), "constant": np.ones(800)}
    laws = tuple(
        Law(name, lambda _, own=own: own[:, None], np.ones(1), ("size",), ("mm",), confirm="measure it")
        for name, own in columns.items()
    )
    base = Base.flat(("offset",), np.ones((800, 1)))
    whole = Channel(slow, "mm", (slice(0, 800),), ("run",), (), base, laws, time=rows)
    settled = settle(replace(whole, static=()), look=False, beginnings=(Beginning.NOTHING,))
    assert settled.noise.correlation_samples > 5.0
    found = {one.follows: one.concealed for one in detectable_causes(settled)}
    assert found == pytest.approx({"wave": 0.0, "constant": 1.0}, abs=0.02)


def test_a_larger_margin_than_one_is_on_every_size(nothing):
    cause = next(c for c in nothing.causes if c.name == "curve over load")
    variant = cause.variants[0]
    samples = nothing.bank.samples(variant.columns)
    samples = samples - samples.mean(axis=0)
    products = nothing.comparison.beside((), variant.columns)
    least = least_seen(products, samples, variant.plausible, cause.log_prior_odds + variant.log_weight)
    assert {one.follows: one.size for one in detectable(nothing)}["load"] == pytest.approx(MARGIN * least)


def test_slow_power_is_no_chance(nothing, rng):
    assert slow_chance(nothing) > 1e-3
    walk = np.cumsum(rng.standard_normal(600))
    slow = replace(nothing, channel=replace(nothing.channel, residual=walk * nothing.noise.sigma))
    assert slow_chance(slow) < 1e-3


def followed(answer):
    return Followed((("x",),), (), answer, 1.0, {}, 1.0, ())


@pytest.mark.parametrize(
    ("probability", "classes", "gains", "doubts", "answer"),
    [
        (0.99, (), None, (), Differs.YES),
        (0.99, (), DensityGains((5.0, 5.0)), (), Differs.YES),
        (0.99, (), DensityGains((0.1, 0.1)), (), Differs.CANNOT_TELL),
        (0.99, (followed(FollowsAnswer.HAPPENED),), DensityGains((0.1, 0.1)), ("slow",), Differs.YES),
        (0.99, (followed(FollowsAnswer.DOES_NOT_PREDICT),), DensityGains((0.1, 0.1)), (), Differs.CANNOT_TELL),
        (0.20, (), DensityGains((0.1, 0.1)), ("slow",), Differs.CANNOT_TELL),
        (0.20, (), DensityGains((0.1, 0.1)), (), Differs.NO),
    ],
)
def test_whether_anything_differs(probability, classes, gains, doubts, answer):
    assert difference_of(probability, classes, gains, doubts)[0] is answer


def test_what_happened_beside_refuted_effects_is_no_difference():
    """It can make up for them: one in ten parts is then predicted worse than as simulated, and nothing else speaks for it."""
    classes = (followed(FollowsAnswer.DOES_NOT_PREDICT), followed(FollowsAnswer.HAPPENED))
    gains = DensityGains((-1.0, -2.0))
    assert difference_of(0.99, classes, gains, (), correction=False)[0] is Differs.CANNOT_TELL
    assert difference_of(0.99, classes, gains, (), correction=True)[0] is Differs.YES
    assert difference_of(0.99, classes[1:], gains, (), correction=False)[0] is Differs.YES


@pytest.mark.parametrize(("parts", "named"), [((3.0, 2.0, 1.0), True), ((3.0, 0.0, -0.5), False), ((0.0,) * 3, True)])
def test_no_law_is_named_against_held_out_rows(both, parts, named):
    """Errors of a law's own in parts, without the best of them, decide; a law that other names stood for is not refuted."""
    _, settled, without = both
    folds = (
        Fold("part", 60, 1.0, 1.0, 0.5, {("hysteresis of q",): gain, ("twice per turn of angle",): 1.0})
        for gain in parts
    )
    found = levels_of(settled, left_over(settled), ChosenWithoutParts(without[:3], HeldOutError(tuple(folds))))
    forms = {one.name: one.form.name for one in found.follows}
    assert forms == {"q": "hysteresis of q" if named else None, "angle": "twice per turn of angle"}


def test_time_and_single_rows_are_the_time():
    data = table(4, rows=400)
    inside = (np.arange(400) >= 200) & (np.arange(400) < 300)
    whole = channel(data, blocks=1)
    settled = settle(replace(whole, residual=whole.residual + 0.4 * inside))
    (one,) = levels_of(settled, left_over(settled), None).follows
    assert one.name == TIME
    assert one.answer is FollowsAnswer.HAPPENED


def test_a_sum_has_each_of_its_laws_named_beside_the_others():
    """A play and a parabola of one variable: no single law makes both."""
    data = table(6, lambda d: EFFECTS["hysteresis of q"](d) + 0.2 * (d.q / 50.0) ** 2, rows=600)
    whole = channel(data, blocks=1)
    settled = settle(whole, thorough=False)
    (one,) = classes_of(settled, VariableProbabilities(settled))
    assert len(one.members) == 2
    form = law_form(settled, one, [rows for _, rows in parts_of(whole)])
    assert form.name is None
    assert set(form.together) == {"hysteresis of q", "curve over q"}
    assert set(law_form(settled, one, None).names) == set(form.together)
    levels = levels_of(settled, left_over(settled), None)
    assert {f.name for f in read_off(settled, Trial(), levels) if f.verdict is Verdict.IDENTIFIED} == set(form.together)


def test_the_straight_line_through_an_effect_is_that_of_least_squares(both):
    data, settled, _ = both
    follows = {one.name: one for one in levels_of(settled, left_over(settled), None).follows}
    effect = settled.effect(["hysteresis of q"])
    slope, _ = np.polyfit(data.q, effect, 1)
    assert follows["q"].slope.value == pytest.approx(slope, rel=1e-6)
    assert follows["q"].slope.unit == "mm/mm"
    assert follows["q"].straight == pytest.approx(np.corrcoef(data.q, effect)[0, 1] ** 2, rel=1e-6)
    assert follows["angle"].slope is None


@pytest.mark.parametrize(
    ("answer", "form", "verdict"),
    [
        (FollowsAnswer.FOLLOWS, "hysteresis of q", Verdict.IDENTIFIED),
        (FollowsAnswer.FOLLOWS, None, Verdict.AMBIGUOUS),
        (FollowsAnswer.DOES_NOT_PREDICT, None, Verdict.DOES_NOT_PREDICT),
        (FollowsAnswer.UNDECIDED, None, Verdict.AMBIGUOUS),
        (FollowsAnswer.NOT_TESTED, "hysteresis of q", Verdict.IDENTIFIED),
    ],
)
def test_a_verdict_is_read_off_the_level_of_the_class(both, answer, form, verdict):
    _, settled, _ = both
    levels = levels_of(settled, left_over(settled), None)
    law = (
        None
        if answer is FollowsAnswer.UNDECIDED
        else LawForm(form, () if form else ("hysteresis of q", "curve by direction over q"), ())
    )
    classes = [replace(one, answer=answer, form=law) if one.name == "q" else one for one in levels.follows]
    found = {one.name: one for one in read_off(settled, Trial(), replace(levels, follows=tuple(classes)))}
    assert found["hysteresis of q"].verdict is verdict
    if answer is FollowsAnswer.FOLLOWS and form is None:
        assert found["hysteresis of q"].ambiguous_with == ("curve by direction over q",)


def said_of_hysteresis(settled, form, answer, probability):
    follows = Followed((("q",),), (), answer, 1.0, {}, 1.0, ("curve over q", "hysteresis of q"), form=form)
    levels = replace(levels_of(settled, left_over(settled), None), follows=(follows,))
    return CauseJudge(settled, Trial(), levels)._of_member("hysteresis of q", probability, 9.0)


@pytest.mark.parametrize(("probability", "verdict"), [(0.96, Verdict.DOES_NOT_PREDICT), (0.9, Verdict.AMBIGUOUS)])
def test_held_out_parts_refute_no_member_that_is_not_sure(both, probability, verdict):
    assert said_of_hysteresis(both[1], None, FollowsAnswer.DOES_NOT_PREDICT, probability)[0] is verdict


def test_what_is_named_beside_it_is_no_rival_of_a_member_of_a_sum(both):
    rivals = {"hysteresis of q": ("hysteresis of q", "curve by direction over q")}
    form = LawForm(None, (), (), together=("curve over q",), rivals=rivals)
    verdict, others, _ = said_of_hysteresis(both[1], form, FollowsAnswer.FOLLOWS, 1.0)
    assert verdict is Verdict.AMBIGUOUS
    assert others == ("curve by direction over q",)


def test_what_leaves_more_than_as_simulated_is_not_identified(both):
    _, settled, _ = both
    levels = levels_of(settled, left_over(settled), None, worse=True)
    assert levels.correction is False
    found = read_off(settled, Trial(), levels)
    assert {one.verdict for one in found if one.name in settled.best.names} == {Verdict.DOES_NOT_PREDICT}


def test_a_search_ends_at_its_limit_with_the_best_so_far(both):
    data, settled, _ = both
    whole = channel(data, blocks=1)
    short = settle(whole, most_work=1.0)
    assert short.stopped
    assert not settled.stopped
    assert short.best.members
    silent = settle(replace(whole, residual=table(3, rows=600).residual), most_work=1.0)
    assert silent.stopped
    assert levels_of(silent, left_over(silent), None).differs.why == "the search ended at its limit of work"


def test_a_spent_search_that_meets_an_earlier_outcome_is_judged_in_its_columns(rng, monkeypatch):
    """A law laid out at its own width has columns that a search without work for that never made."""
    x = rng.uniform(-1.0, 1.0, 400)
    law = Law(
        "turn",
        lambda point: np.tanh(x / point[0])[:, None],
        np.ones(1),
        ("size", "width"),
        ("mm", "mm"),
        ((0.1, 0.3, 0.9),),
    )
    whole = Channel(
        np.tanh(x / 0.3) + 0.05 * rng.standard_normal(400),
        "mm",
        (slice(0, 400),),
        ("run",),
        (),
        Base.flat(("offset",), np.ones((400, 1))),
        (law,),
        time=np.arange(400.0),
    )
    first = settle(replace(whole, static=()), look=False, beginnings=(Beginning.NOTHING,))
    monkeypatch.setattr(settling, "_meets", lambda *_: True)
    how = settling._How(look=False, work=SearchWork(1.0))
    spent = settling._from(Bank(whole), (), Beginning.NOTHING, how, [first])
    assert first.best.members[0].columns.max() >= Bank(whole).count
    assert spent.stopped
    assert spent.log_probability == first.log_probability


def test_a_torque_carries_the_difference_and_a_temperature_does_not(rng):
    """A pendulum that is simulated without its friction: its torque follows the true motion."""
    t = np.arange(800) * 0.02
    simulated = np.sin(1.3 * t) + 0.4 * np.sin(2.9 * t + 1.0)
    true = simulated + 0.05 * np.sin(0.7 * t) + 0.03 * np.cos(3.1 * t)
    torque = 2.0 * np.gradient(np.gradient(true, t), t) + 0.7 * true + 0.01 * rng.standard_normal(800)
    columns = {
        "torque": torque,
        "speed": np.gradient(simulated, t),
        "warm": 20.0 + t + 0.02 * rng.standard_normal(800),
        "other": np.sin(0.7 * t),
    }
    variables = {name: Variable(name, "", Kind.ANY, values) for name, values in columns.items()}
    whole = Channel(
        true - simulated,
        "rad",
        (slice(0, 800),),
        ("run",),
        tuple(variables.values()),
        Base.flat(("offset",), np.ones((800, 1))),
        time=t,
        simulated=Variable("simulated", "rad", Kind.ANY, simulated),
    )
    assert {name for name, one in variables.items() if may_result(one, whole)} == {"torque"}
    assert not may_result(variables["torque"], replace(whole, time=None))


def test_a_correction_is_made_of_what_follows(both):
    """A play that follows beside a step in time: refits by least squares with the play alone."""
    data, settled, parts = both
    levels = levels_of(settled, left_over(settled), None)
    happened = [replace(one, answer=FollowsAnswer.HAPPENED) if one.name == "angle" else one for one in levels.follows]
    assert levels.corrects == {"q", "angle"}
    assert replace(levels, follows=tuple(happened)).corrects == {"q"}
    assert replace(levels, follows=()).corrects == frozenset()
    expected = [np.sqrt(squares(data.residual, [direction(data.q)], part.rows) / part.rows.sum()) for part in parts]
    chosen = ChosenWithoutParts(parts)
    assert chosen.errors_with({"q"}) == pytest.approx(expected, rel=0.02)
    every = [
        float(np.std(part.settled.channel.residual[part.rows] - part.settled.predicted()[part.rows])) for part in parts
    ]
    assert chosen.errors_with(()) == pytest.approx(every, rel=0.05)
    assert np.mean(chosen.errors_with(())) < np.mean(chosen.errors_with({"q"}))


def test_an_effect_with_another_name_in_a_part_is_corrected():
    """A screw that turns with its axis comes first without a part: play of the one is play of the other."""
    data = table(5, EFFECTS["hysteresis of q"], rows=600)
    whole = channel(data, blocks=1)
    screw = Variable("screw", "deg", Kind.LENGTH, 18.0 * data.q)
    whole = replace(whole, variables=(screw, *whole.variables))
    rows = parts_of(whole)[3][1]
    part = WithoutPart(rows, settle(whole.without(rows), look=False, beginnings=ONE))
    assert part.settled.best.names == {"hysteresis of screw"}
    for wanted, columns in (("q", [direction(data.q)]), ("load", [])):
        expected = np.sqrt(squares(data.residual, columns, rows) / rows.sum())
        assert ChosenWithoutParts([part]).errors_with({wanted}) == pytest.approx([expected], rel=0.02)


@pytest.mark.parametrize(
    ("concealed", "said"),
    [
        (0.999, "Fitted parameters can hide gravity wholly. Measure f at two heights."),
        (0.91, "Up to 4 µm rms of gravity may be hidden: fitted parameters take up 91 % of its squares."),
    ],
)
def test_what_fitted_parameters_hide_is_said_with_what_shows_it(concealed, said):
    gravity = Detectable("gravity", 4.0, concealed, "Measure f at two heights.")
    differs = DifferenceFound(Differs.NO, "", 0.1, 1.0, False, 900.0, (gravity,))  # noqa: FBT003
    assert said in " ".join(level_sentences(Levels(differs, (), None), "µm", {}))


@pytest.mark.parametrize(
    ("form", "lines"),
    [
        (LawForm("linear in y", (), ()), 0),
        (LawForm(None, (), (), ("linear in y", "product of x and y")), 1),
        (LawForm("curve over y", (), ()), 1),
    ],
)
def test_the_whole_line_is_said_where_no_law_alone_states_it(form, lines):
    """A product that is zero at an end of its range carries a part of the shear, so that its neighbour's slope is too small."""
    shear = Value(-3.9e-5, 1e-6, "mm/mm")
    one = replace(followed(FollowsAnswer.FOLLOWS), variables=(("y",),), form=form, slope=shear, straight=0.9)
    levels = Levels(DifferenceFound(Differs.YES, "", 1.0, 1.0, False, 900.0, ()), (one,), None)  # noqa: FBT003
    said = " ".join(level_sentences(levels, "mm", {"linear in y": {"slope": Value(-2e-5, 2e-6, "mm/mm")}}))
    assert said.count("-3.90e-05 ± 1.0e-06 mm/mm") == lines
