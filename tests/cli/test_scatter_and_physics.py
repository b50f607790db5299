"""What `calibrate` says of balls that scatter: missing physics comes first, and less than stated is no alarm."""

from __future__ import annotations

import pytest

from dbbstation.cli import DONE
from tests.plant.mechanisms.balls import CmmScatter, MountingScatter
from tests.plant.mechanisms.bar import RandomBarOffset
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("answers_kept")
ERRORS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)


@pytest.fixture
def said(run, tmp_path):
    """What the command prints and its numbers, of fifteen circles of a machine with these further mechanisms."""

    def of(*mechanisms, setup=None):
        folder = tmp_path / "session"
        record(folder, seed=11, plan=table_ii_plan(11), mechanisms=[ERRORS, *mechanisms], setup=setup, rate_hz=10.0)
        printed, data = run("calibrate", folder), run("calibrate", folder, "--json")
        assert printed.code == data.code == DONE, printed.err
        return printed.out, data.data

    return of


def use(printed):
    return next(line for line in printed.splitlines() if line.startswith("Use this model: "))


def scatter(printed):
    return [line for line in printed.splitlines() if line.startswith("balls stated")]


def test_beside_gravity_missing_physics_is_the_likelier_reason(said):
    """A third of the reference machine's compliance: 1.2 µm rms of it are left where noise is 0.5."""
    printed, data = said(Gravity(compliance_mm_n=3e-6))
    more = [line for line in scatter(printed) if "more than stated" in line]
    assert more
    for line in more:
        assert "physics that the model lacks" in line
        assert "diagnose" in line
        assert "NOT as stated" not in line
    assert data["misfit"]["missing_physics"] is True
    assert data["misfit"]["rms_um"] > 0.5
    assert use(printed).startswith(f"Use this model: no. {data['misfit']['rms_um']:.2f} µm rms")


def test_missing_physics_is_told_before_the_balls(said):
    printed, _ = said(Gravity(compliance_mm_n=3e-6))
    lines = printed.splitlines()
    physics = next(k for k, line in enumerate(lines) if "dbbstation diagnose" in line)
    assert physics < lines.index(scatter(printed)[0])


def test_faint_physics_is_seen_where_the_residual_hardly_grows(said):
    """A tenth of the compliance leaves 0.56 µm where noise is 0.50: not a fifth more, but nothing that chance does."""
    printed, data = said(Gravity(compliance_mm_n=1e-6))
    assert data["residual_within_mounting_rms_um"] < 1.2 * data["noise_um"]
    assert data["misfit"]["missing_physics"] is True
    assert "dbbstation diagnose" in printed


def test_balls_that_stand_better_than_stated_are_no_alarm(said):
    printed, data = said(setup=[RandomBarOffset()])
    assert "NOT as stated" not in printed
    assert all("less than stated" in line for line in scatter(printed))
    assert [check["fits"] for check in data["scatter"]] == [True, True]
    assert [check["finding"] for check in data["scatter"]] == ["less", "less"]
    assert data["misfit"]["missing_physics"] is False


def test_balls_that_scatter_more_without_missing_physics_are_an_alarm(said):
    printed, data = said(setup=[MountingScatter(factor=5.0), CmmScatter(), RandomBarOffset()])
    assert any("NOT as stated" in line for line in scatter(printed))
    assert not any("physics" in line for line in scatter(printed))
    assert "cannot tell. The balls scatter by more than stated" in use(printed)
    assert data["misfit"]["missing_physics"] is False


def test_where_all_is_as_stated_nothing_is_missing(said):
    printed, data = said()
    assert all(line.endswith("as stated") for line in scatter(printed))
    assert data["misfit"]["missing_physics"] is False
    assert "diagnose" not in printed
    x, y, z = data["centre_u_um"]
    assert z is None  # level circles leave the common height open
    assert (
        f"yes, at these places. Its residual is noise; u of the tool there is at most X {x:.1f} µm, Y {y:.1f} µm, Z unknown"
        in use(printed)
    )
