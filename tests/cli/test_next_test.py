"""What `diagnose` proposes to measure next is worth the work: it changes a verdict or halves an uncertainty."""

from __future__ import annotations

import pytest

from dbbstation.cli import DONE
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("answers_kept")

ERRORS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory, run):
    """What the command says of a source that these tests of the jig plan do not see: as printed, and its numbers."""

    def of(tests, source):
        folder = tmp_path_factory.mktemp("next") / "session"
        record(folder, seed=11, plan=subset(table_ii_plan(11), tests), mechanisms=[ERRORS], rate_hz=5.0)
        printed, data = (run("diagnose", folder, "--sources", source, *more) for more in ([], ["--json"]))
        assert printed.code == data.code == DONE, printed.err
        (found,) = (entry for entry in data.data["sources"] if entry["name"] == source)
        assert found["verdict"] == "not-testable"
        return printed.out, data.data

    return of


def test_nothing_is_proposed_where_nothing_is_gained(diagnosed):
    """A tilted circle more tells the ball's offset to 0.0127 instead of 0.0129 mm: an hour's work for nothing."""
    printed, data = diagnosed("abcdef", "tool-ball-offset")
    assert data["next_test"] is None
    assert data["further_tests"] == []
    (line,) = (line for line in printed.splitlines() if line.startswith("measure next"))
    assert "no proposal; up to three further tests would neither change a verdict nor halve u" in line


def test_what_is_proposed_halves_an_uncertainty(diagnosed):
    printed, data = diagnosed("afghk", "screw-lead")
    tests = [data["next_test"], *data["further_tests"]]
    assert tests[0] is not None
    first, last = tests[0]["sigma_before"], tests[-1]["sigma_after"]
    assert last <= 0.5 * first
    # Not one test more than that needs.
    assert all(test["sigma_after"] > 0.5 * first for test in tests[:-1])
    (line,) = (line for line in printed.splitlines() if line.startswith("measure next"))
    assert f"to {last:.2g} instead of {first:.2g} µm/m" in line
    for test in tests:
        assert test["text"] in line
