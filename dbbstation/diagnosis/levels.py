"""Present the circles' results as results of a generic channel, for answers and verdicts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import is_missing_physics, remainder_of
from dbbstation.calibration.outliers.outlier import OutlierKind
from dbbstation.diagnosis.limits import where_left
from dbbstation.diagnosis.parts import SESSION_TIME, variable_of
from dbbstation.diagnosis.shapes import SIGNED
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel, Law
from dbbstation.inference.coloured import Coloured
from dbbstation.inference.left_over import SIGNIFICANT, LeftOver, ResidualTest
from dbbstation.inference.levels import BALL, BAR, RUN, Differs, Followed, FollowsAnswer
from dbbstation.inference.levels_of import levels_by_tests
from dbbstation.inference.settled import Settled

if TYPE_CHECKING:
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.explained import Explained, SettledCircles
    from dbbstation.inference.chosen_anew import KnownGains
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.model_comparison import Cause
    from dbbstation.inference.projection import BesideBase


class CircleBank(Bank):
    """A bank of columns that circles already have, in white noise."""

    def __init__(self, rows: Channel, circles: CircleChannel, settled: SettledCircles) -> None:
        self.channel, self.patterns, self.laws = rows, {}, {law.name: law for law in rows.laws}
        self.noise, self.whitening, self.tails = Coloured(settled.noise_mm), None, np.inf
        self._columns, self._circles, self._scatter = circles.columns, circles, settled.scatter
        self.nameless = frozenset(cause.name for cause in settled.causes if not cause.named)

    def samples(self, columns: Integers) -> Floats:
        """Return columns over all rows, shape (n, p) [mm]."""
        return self._columns.of(columns)

    def beside(self, but_for: Flags | None = None, only: Integers | None = None) -> BesideBase:
        """Return causes with the base projected out."""
        return self._circles.beside_base(self.noise.sigma, self._scatter, but_for, only)


def outcome_of(explained: Explained) -> Settled:
    """Return the circles' results as a generic outcome [mm]."""
    circles, settled = explained.channel, explained.settled
    base = circles.base
    rows = Channel(
        residual=settled.target,
        unit="mm",
        blocks=tuple(circles.runs),
        names=tuple(f"{o.test} {o.raw.circle.direction}" for o in circles.observations),
        variables=(),
        base=Base(("the kinematic parameters",), circles.columns.base, base.prior, base.random),
        laws=tuple(_law(explained, cause) for cause in settled.causes),
        interchangeable=EQUIVALENT**2,
        rows_are="tests",
    )
    bank = CircleBank(rows, circles, settled)
    return Settled(
        channel=rows,
        bank=bank,
        noise=bank.noise,
        causes=settled.causes,
        comparison=settled.comparison,
        posterior=settled.posterior,
        stopped=settled.stopped,
    )


def _law(explained: Explained, cause: Cause) -> Law:
    settled, circles, variant = explained.settled, explained.channel, cause.variants[0]
    member = next((m for m in settled.best.members if m.name == cause.name), None)
    variant = variant if member is None else member.variant
    source = circles.sources.get((cause.name, variant.law))
    follows = settled.unmodelled.follows.get(cause.name)
    once = cause.setup or (source is not None and circles.happens_once(cause.name))
    if cause.setup:
        variable = BAR if cause.name == "bar-offset" else BALL
    elif follows is not None:
        variable = SESSION_TIME if follows.variable == "time" and follows.kind != "wander" else follows.variable
    else:
        variable = RUN if once or source is None else variable_of(source)
    signed = variable.endswith("sign") or (follows is not None and follows.moves == SIGNED)

    def columns(point: tuple[float, ...]) -> Floats:
        return circles.columns.of(next(one.columns for one in cause.variants if one.nonlinear == point))

    return Law(
        cause.name,
        columns,
        variant.plausible,
        (),
        (),
        form_uncertainty=variant.form_uncertainty,
        log_odds=cause.log_prior_odds,
        followed=(variable,),
        way="direction" if signed else "",
        acts_once=once,
        confirm="" if source is None else source.texts.confirm,
    )


def circle_levels(explained: Explained, outcome: Settled, gains: KnownGains | None) -> Levels:
    """Return the three answers for circles [µm]."""
    found = levels_by_tests(outcome, _left(explained), gains).times(1e3)
    unmodelled = explained.settled.unmodelled.follows
    # An effect on no strut has no strut as place, even with all amplitudes.
    nowhere = {name for name, follows in unmodelled.items() if not follows.moves_struts}
    follows = (replace(one, where=None) if nowhere.intersection(one.members) else one for one in found.follows)
    found = replace(found, follows=tuple(follows))
    if not explained.outliers:
        return found
    differs = replace(found.differs, answer=Differs.YES, why="", probability=1.0)
    return replace(found, differs=differs, follows=(*found.follows, *map(_happened, explained.outliers)))


def _happened(outlier: Outlier) -> Followed:
    """Return a ball, bar or run excluded from the fit as a class, in µm."""
    variable = {OutlierKind.RUN: RUN, OutlierKind.BAR: BAR}.get(outlier.kind, BALL)
    return Followed(
        ((variable,),), (), FollowsAnswer.HAPPENED, 1.0, {}, outlier.size_um, (), where=outlier.runs or outlier.test
    )


def _left(explained: Explained) -> LeftOver:
    settled = explained.settled
    if any(settled.unmodelled.of(member) for member in settled.best.members):
        return LeftOver(True, 1.0, ())  # noqa: FBT003 - its first field
    found = remainder_of(settled.after, settled.noise)
    rms_um, where = where_left(settled.after.observations, found)
    is_noise = not is_missing_physics(settled.left) and found.probability >= SIGNIFICANT
    test = ResidualTest("these tests", found.probability, rms_um / 1e3, where)
    return LeftOver(is_noise, found.probability, (test,))
