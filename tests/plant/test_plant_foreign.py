"""Laws of other forms against closed formulas, sessions from their seed, and the score on verdicts written by hand."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.diagnosis.foreign_levels import calibration_of, levels_of, log_bayes_factor, table_of
from tests.plant.foreign.judge import judge
from tests.plant.foreign.score import compare
from tests.plant.foreign.sessions import (
    KINDS,
    LEAST_SIZE,
    WIDE_KINDS,
    broad_machine,
    kind_of,
    make,
    slender_machine,
    small_machine,
)
from tests.plant.machine import TRAVEL, reference_machine
from tests.plant.mechanisms.reversal_forms import SoftBacklash, StickSlip

if TYPE_CHECKING:
    from pathlib import Path

UNUSED: Any = None
TO_AND_FRO_MM = np.tile(np.concatenate([np.linspace(0.0, 1.0, 1001), np.linspace(1.0, 0.0, 1001)[1:]])[:, None], 6)


def test_soft_backlash_comes_to_its_other_side_exponentially() -> None:
    change_um = 1000.0 * SoftBacklash((8.0,) * 6, (50.0,) * 6).driven_mm(UNUSED, TO_AND_FRO_MM)[:, 0]
    assert change_um[1000] == pytest.approx(-4.0, abs=1e-6)
    travel_um = np.arange(1.0, 1001.0)
    # From minus to plus half the gap of 8 µm: Dahl's law, integrated by hand.
    assert change_um[1001:] == pytest.approx(4.0 - 8.0 * np.exp(-travel_um / 50.0), abs=1e-6)


def test_a_strut_sticks_and_jumps_a_few_times_after_it_turned_round() -> None:
    late_um = 1000.0 * StickSlip((4.5, 0.0, 0.0, 0.0, 0.0, 0.0), jerks=2).driven_mm(UNUSED, TO_AND_FRO_MM)
    assert not late_um[:1001].any()
    assert not late_um[:, 1:].any()
    expected_um = [*(1.0, 2.0, 3.0, 4.0), *(0.5, 1.5, 2.5, 3.5), *[0.0] * 992]
    assert late_um[1001:, 0] == pytest.approx(expected_um, abs=1e-6)


def test_the_small_robot_has_eight_tenths_of_every_radius_and_its_own_angles() -> None:
    small, large = small_machine(), reference_machine()
    for of_small, of_large in (
        (small.base_joints_mm, large.base_joints_mm),
        (small.platform_joints_mm, large.platform_joints_mm),
    ):
        assert np.hypot(*of_small[:, :2].T) == pytest.approx(0.8 * np.hypot(*of_large[:, :2].T))
        angles_rad = np.arctan2(of_small[:, 1], of_small[:, 0]) - np.arctan2(of_large[:, 1], of_large[:, 0])
        assert np.all(np.abs(np.sin(angles_rad)) > 0.05)


def test_two_more_robots_have_struts_within_the_travel_of_the_plan() -> None:
    for machine in (broad_machine(), slender_machine()):
        tip_mm = np.array([0.0, 0.0, -1008.0])
        struts_mm = np.linalg.norm(machine.platform_joints_mm + tip_mm - machine.base_joints_mm, axis=1)
        assert np.ptp(struts_mm) < 1e-9
        assert TRAVEL["strut_mm"][0] < struts_mm[0] < TRAVEL["strut_mm"][1]  # type: ignore[index]


def test_kinds_are_those_promised_in_every_sixty() -> None:
    for first in (1, 61):
        assert Counter(kind_of(5, number) for number in range(first, first + 60)) == Counter(KINDS)
    wide = Counter(kind_of(5, number, wide=True) for number in range(1, 251))
    assert wide == Counter(5 * WIDE_KINDS)
    assert wide["clean"] == 50


def test_a_seed_makes_the_same_session_and_an_answer_is_not_made_twice(tmp_path: Path) -> None:
    number = next(n for n in range(1, 61) if kind_of(48, n) == "pair")
    one, two = (make(tmp_path / part, 48, number) for part in ("one", "two"))
    assert one == two | {"truth": one["truth"]}
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one" / one["session"]).rglob("*.*"))
    assert len([file for file in files if file.suffix == ".csv"]) == 30
    assert all((tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes() for file in files)
    assert all(effect["size"] >= LEAST_SIZE for effect in one["effects"] if effect["listed"])
    (tmp_path / "one" / one["session"] / "plan.yaml").unlink()
    assert make(tmp_path / "one", 48, number)["seed"] == one["seed"]
    assert not (tmp_path / "one" / one["session"] / "plan.yaml").exists()


@pytest.mark.parametrize(("stops", "kept"), [("interrupted; what was written stays", False), ("no such run", True)])
def test_an_interrupted_diagnosis_is_not_kept(tmp_path: Path, stops: str, *, kept: bool) -> None:
    program = tmp_path / "checkout" / "dbbstation"
    program.mkdir(parents=True)
    (program / "__init__.py").touch()
    (program / "__main__.py").write_text(f"import sys\nsys.exit({stops!r})\n", encoding="utf-8")
    if kept:
        assert judge(tmp_path, program.parent, "0123abcd", "0001")["error"].strip() == stops
    else:
        with pytest.raises(SystemExit, match="0001: diagnose was interrupted"):
            judge(tmp_path, program.parent, "0123abcd", "0001")
    assert (tmp_path / "verdicts" / "0123abcd" / "0001.json").exists() == kept


def _source(name: str, verdict: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "verdict": verdict, "ambiguous_with": [], "parameters": {}, "class": []} | more


def _verdict(after_um: float, *sources: dict[str, Any]) -> dict[str, Any]:
    residual = {"before": 2.0, "after": after_um}
    summary = {"mismatch": True, "residual_rms_um": residual, "sources": list(sources)}
    return {"summary": summary, "processor_s": 1.0, "memory_mb": 1.0}


def test_the_score_counts_names_values_and_silence() -> None:
    gap = {
        "name": "backlash",
        "listed": True,
        "amplitudes": {"strut_1_um": 5.0},
        "largest_amplitude": 5.0,
        "unit": "µm",
    }
    walk = {"name": "wandering-bar", "listed": False, "amplitudes": {}, "largest_amplitude": 0.05, "unit": "µm"}
    answer = {"kind": "single", "effects": [gap, walk], "circumstances": {"machine": "one"}}
    found = _source("backlash", "identified", parameters={"strut_1_um": {"value": 5.4, "uncertainty": 0.1}})
    said = compare(answer, _verdict(0.4, found, _source("servo-lag", "identified"), _source("play", "ruled-out")))
    assert (said["right"], said["wrong"], said["without_answer"]) == (["backlash"], ["servo-lag"], False)
    assert said["values_u"] == {"backlash strut_1_um": 4.0}
    # A name of the same class, and an ambiguity that holds the cause, are no wrong names; an ambiguity without it is one.
    assert not compare(answer, _verdict(0.4, _source("play", "identified", **{"class": ["backlash"]})))["wrong"]
    pairs = [_source("play", "ambiguous", ambiguous_with=["backlash"]), _source("ball-form", "ambiguous")]
    unsure = compare(answer, _verdict(0.4, *pairs))
    assert (unsure["right"], unsure["right_or_unsure"], unsure["wrong"]) == ([], ["backlash"], ["(ball-form)"])
    silent = compare(answer, _verdict(2.0, _source("backlash", "not-testable")))
    assert silent["without_answer"]
    assert silent["silent"]


def test_levels_are_scored_by_variables_that_were_put_in() -> None:
    """One of two effects is located, one of two classes is of neither, and of a class that is not sure nothing counts."""

    def sizes(testable: float) -> dict[str, Any]:
        return {"size": testable, "amplitudes": {"one": 1.0}, "listed": True}

    answer = {
        "effects": [
            {"name": "backlash", "variables": ["strut-speed-sign"], **sizes(4.0)},
            {"name": "gravity", "variables": ["strut-force"], **sizes(2.0)},
        ]
    }

    def one(variable: str, said: str = "follows") -> dict[str, Any]:
        sure = 1.0 if said == "follows" else 0.6
        tested = {"before": 2.0, "after": 1.0}
        return {"variables": [[variable]], "or_variables": [], "answer": said, "probability": sure, **tested}

    follows = [one("travel since its reversal"), one("tilt of the platform"), one("strut-force", "undecided")]
    sources = [{"name": name, "verdict": "identified", "probability": 0.97} for name in ("backlash", "play")]
    said = {"differs": {"answer": "yes", "probability": 1.0}, "follows": follows}
    row = levels_of(answer, {"levels": said, "sources": sources})
    assert row["located"] == ["backlash"]
    assert row["wrong_classes"] == ["tilt of the platform"]
    assert len(row["classes"]) == 2
    # 20 standard deviations: 200 - 1/2 log 401; 10 of them: 50 - 1/2 log 101.
    assert [log_bayes_factor(one) for one in answer["effects"]] == pytest.approx([197.003, 47.692], abs=1e-3)
    assert row["loud"] == ["backlash"]
    scored = {
        "named": ["backlash"],
        "right": ["backlash"],
        "right_or_unsure": ["backlash"],
        "listed": 2,
        "wrong": [],
        "levels": row,
        "robot": "one",
        "held_out_over_true": 1.25,
    }
    table = table_of({"0001": scored}, {"command": "c", "date": "2026-11-27", "seed": 1}, "")
    assert table["figures"]["effects that a class follows"][0] == "1 of 2"
    assert table["figures"]["classes that no effect follows"][0] == "1 of 2"
    assert table["figures"]["listed causes that were named"][0] == "1 of 2"
    assert table["figures"]["log Bayes factor above 100: named"][0] == "1 of 1"
    assert table["figures"]["held-out error over that of the causes put in"][1] == "median 1.25"
    table, drawn = calibration_of({"0001": scored}, {"command": "c", "date": "2026-11-27", "seed": 1})
    assert [cell.split(",")[0] for cell in table["figures"]["0.95 to 1"]] == ["1 of 1", "1 of 2", "1 of 2"]
    assert [cell.split(",")[0] for cell in table["figures"]["0.5 to 0.8"]] == ["0 of 0", "1 of 1", "0 of 0"]
    assert drawn.count(b"which cause") == 1
