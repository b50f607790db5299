"""What happens at one place of a circle, and what reversals of struts leave in odd undulations."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.plan.plan import Direction
from dbbstation.quality.between import local_difference
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Others, seen
from dbbstation.trace.expected import local_columns
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record
from tests.quality.sessions import NOISE, finding_of, read, sound
from tests.quality.spoilers import bumpy, progress


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return sound(tmp_path_factory.mktemp("local") / "session", 7, "bh")


def dirty(recording, circle, um, half_deg=30.0, at_deg=200.0):
    """A bump as wide as dirt in a cup makes it: nothing in it is too short for form."""
    theta = circle.theta_deg(progress(recording, circle))
    apart = np.abs(np.mod(theta - at_deg + 180.0, 360.0) - 180.0)
    bump = np.where(apart < half_deg, 0.5 * (1.0 + np.cos(np.pi * apart / half_deg)), 0.0)
    return replace(recording, length_mm=recording.length_mm + 1e-3 * um * bump)


@pytest.mark.parametrize(("um", "half_deg"), [(15.0, 30.0), (-15.0, 30.0), (45.0, 60.0), (15.0, 15.0)])
def test_dirt_in_one_direction_is_found_where_it_is(whole, um, half_deg):
    first, second = whole.runs[2], whole.runs[3]
    spoilt = seen(replace(second.run, recording=dirty(second.run.recording, second.run.circle, um, half_deg)))
    found = finding_of(SessionRuns([first, spoilt]).judge(spoilt), Name.LOCAL)
    assert found.verdict is FindingVerdict.WRONG
    assert "clean" not in found.short
    at_deg = float(found.short.rpartition(" at ")[2].split(" ")[0])
    # A bump as wide as a third of the turn shows by what stands beside it, too.
    assert abs(at_deg - 200.0) < max(12.0, half_deg)
    # The first direction was the one that counts: it is told the same when it is measured again.
    assert finding_of(SessionRuns([first, second]).judge(second), Name.LOCAL).verdict is FindingVerdict.GOOD


def test_without_another_run_nothing_can_be_told(whole):
    found = finding_of(SessionRuns([]).judge(whole.runs[0]), Name.LOCAL)
    assert found.verdict is FindingVerdict.CANNOT_TELL


def test_a_short_bump_is_the_runs_own(whole):
    one = whole.runs[3]
    spoilt = seen(replace(one.run, recording=bumpy(one.run.recording, one.run.circle, 20.0)))
    assert finding_of(SessionRuns([]).judge(spoilt), Name.BUMP).verdict is FindingVerdict.WRONG


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gaps_um", "lags_ms"),
    [
        ((4.0, 8.0, 6.0, 10.0, 3.0, 7.0), (2.0,) * 6),
        ((20.0, 0, 0, 0, 0, 0), (2.0,) * 6),
        ((0.0,) * 6, (2, 8, 5, 6, 3, 4)),
    ],
    ids=["play in all", "play in one", "lag"],
)
def test_reversals_are_no_place(tmp_path, gaps_um, lags_ms):
    plan = subset(table_ii_plan(3), list("bdhn"))
    mechanisms = [RandomKinematics(), Backlash(gap_um=gaps_um), ServoLag(lags_ms)]
    record(tmp_path / "s", seed=3, plan=plan, mechanisms=mechanisms, noise=NOISE)
    whole = read(tmp_path / "s")
    session = SessionRuns(whole.runs)
    for one in whole.runs:
        found = finding_of(session.judge(one), Name.LOCAL)
        assert found.verdict is FindingVerdict.GOOD, (one.run.label, found.value, found.limit)


def test_a_drift_of_both_is_no_place():
    theta = np.radians(np.arange(0.0, 360.0, 0.5))
    closure = SimpleNamespace(height_um=20.0)
    noise = SimpleNamespace(known=True, sigma_um=1e-3)
    analysis = SimpleNamespace(closure=closure, noise=noise, raw=theta)

    def run(sign, direction, more_um=0.0):
        saw = sign * 20.0 * theta / (2.0 * np.pi) + more_um * np.exp(-0.5 * ((theta - 2.0) / 0.2) ** 2)
        circle = SimpleNamespace(direction=direction)
        local, *_ = np.linalg.lstsq(local_columns(theta), saw, rcond=None)
        label = SimpleNamespace(circle=circle, label="x", expected=None)
        return SimpleNamespace(run=label, analysis=analysis, local_um=local, u_um=1e-3)

    there, back = run(1.0, Direction.CCW), run(-1.0, Direction.CW)
    assert local_difference(there, Others(opposite=back)).verdict is FindingVerdict.GOOD  # type: ignore[arg-type]
    bumped = run(1.0, Direction.CCW, more_um=60.0)
    assert local_difference(bumped, Others(opposite=back)).verdict is FindingVerdict.WRONG  # type: ignore[arg-type]


def test_shift_length_and_ovality_move_no_place():
    """Of a bump of all undulations, those by 3 to 29 count: each adds twice its size at the top, where they agree."""
    raw, top = np.radians(np.arange(0.0, 360.0, 0.5)), local_columns(np.radians([200.0]))[0]
    analysis = SimpleNamespace(closure=None, noise=SimpleNamespace(known=True, sigma_um=1e-3), raw=raw)
    label = SimpleNamespace(circle=SimpleNamespace(direction=Direction.CCW), label="x", expected=None)
    one, other = (
        SimpleNamespace(run=label, analysis=analysis, local_um=um, u_um=1e-3) for um in (0.1 * top, 0.0 * top + 1e-9)
    )
    found = local_difference(one, Others(opposite=other))  # type: ignore[arg-type]
    assert found.short == f"the path is {0.1 * 2.0 * 27:+.1f} µm from run x at 200 degrees"
