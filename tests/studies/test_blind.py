"""The study of hidden effects: scoring on verdicts made up here, the way through the files on two short sessions."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from dbbstation.cli import main
from dbbstation.errors import InputError
from studies.__main__ import study as studies
from studies.blind import judge_sessions, read_answers, verdict_folder
from studies.blind_figure import reliability_figure
from studies.blind_reliability import Forecast, reliability
from studies.blind_score import compare, numbers, score
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

CANDIDATES = ("gravity", "backlash", "thermal-struts", "bar-drift", "play")


def effect(name, size=2.0, **more):
    told = {"name": name, "listed": True, "testable": size >= 1, "size": size, "struts": [], "variables": []}
    return told | {"amplitudes": {}} | more


def answer(session, kind, *effects):
    truth = {"delta_length_mm": [0.0] * 6, "delta_base_mm": [[0.0, 0.0, 0.25]] * 6}
    return {
        "session": session,
        "seed": 7,
        "kind": kind,
        "effects": list(effects),
        "raised_bars": False,
        "circumstances": {"plan": "table-ii", "rate_hz": 25.0, "angles": True},
        "truth": truth,
    }


def verdict(*identified, declared=None, mismatch=None, left=(0.0, None, None), parameters=None, shift=()):
    """What a diagnosis might say: names, ambiguities as {name: others}, what is left as (rms, strut, variable)."""
    declared = declared or {}
    sources = []
    for name in CANDIDATES:
        word = "identified" if name in identified else "ambiguous" if name in declared else "ruled-out"
        values = (parameters or {}).get(name, {})
        sources.append(
            {
                "name": name,
                "verdict": word,
                "ambiguous_with": list(declared.get(name, ())),
                "parameters": {k: {"value": v, "uncertainty": u, "unit": "µm"} for k, (v, u) in values.items()},
            }
        )
    summary = {
        "mismatch": bool(identified or declared or left[0]) if mismatch is None else mismatch,
        "sources": sources,
        "unexplained": {"rms_um": left[0], "strut": left[1], "variable": left[2]},
        "locations": [],
        "held_out_rms_um": {"before": 4.0, "after": 0.5},
        "held_out_normalised": {"before": 8.0, "after": 1.0},
        "noise_um": 0.5,
        "parameter_shift": [{"parameter": p, "after_um": a, "uncertainty_um": u} for p, a, u in shift],
    }
    return {"summary": summary, "seconds": 1.0}


def test_known_verdicts_make_a_known_table():
    backlash, gravity, drift = (effect(name) for name in ("backlash", "gravity", "bar-drift"))
    wobble = effect("odd-gear-wobble", listed=False, struts=[3], variables=["strut-length"])
    said = {
        # Clean: silent, a false alarm without a name, one with a name.
        "01": (answer("01", "clean"), verdict()),
        "02": (answer("02", "clean"), verdict(mismatch=True)),
        "03": (answer("03", "clean"), verdict("gravity")),
        # Singles: named; declared; declared too widely; wrongly named; the true name and one too many; unseen.
        "04": (answer("04", "single", backlash), verdict("backlash")),
        "05": (answer("05", "single", backlash), verdict(declared={"backlash": ["play"], "play": ["backlash"]})),
        "06": (answer("06", "single", drift), verdict(declared={"bar-drift": ["play", "gravity", "backlash"]})),
        "07": (answer("07", "single", gravity), verdict("play")),
        "08": (answer("08", "single", gravity), verdict("gravity", "play")),
        "09": (answer("09", "single", gravity), verdict()),
        # Pairs: both; one.
        "10": (answer("10", "pair", gravity, backlash), verdict("gravity", "backlash")),
        "11": (answer("11", "pair", gravity, backlash), verdict("gravity")),
        # Outside: right strut; right variable on another strut; neither; named.
        "12": (answer("12", "outside", wobble), verdict(left=(1.0, 3, "time"))),
        "13": (answer("13", "outside", wobble), verdict(left=(1.0, 2, "strut-length of the reading"))),
        "14": (answer("14", "outside", wobble), verdict(left=(1.0, 5, "angle"))),
        "15": (answer("15", "outside", wobble), verdict("play", left=(1.0, 3, "strut-length"))),
        # One of the list that was not looked for.
        "16": (answer("16", "single", effect("servo-lag", struts=[2])), verdict(left=(1.0, 2, "time"))),
    }
    outcomes = score({k: a for k, (a, _) in said.items()}, {k: v for k, (_, v) in said.items()}, CANDIDATES)
    found = numbers(outcomes)
    hits = {title: (share["hits"], share["count"]) for title, share in found["shares"].items()}
    assert hits == {
        "clean: false alarm": (2, 3),
        "single: detected": (5, 6),
        "single: named": (2, 6),
        "single: named or within a declared ambiguity": (3, 6),
        "single: wrongly named": (2, 6),
        "pair: both named": (1, 2),
        "pair: both named or within a declared ambiguity": (1, 2),
        "pair: wrongly named": (0, 2),
        "outside: detected": (4, 4),
        "outside: given a name": (1, 4),
        "outside: located": (3, 4),
        "not-a-candidate: given a name": (0, 1),
        "not-a-candidate: located": (1, 1),
        "single of 2 to 5 limits: named or within": (3, 6),
    }
    assert found["shares"]["clean: false alarm"]["interval"] == pytest.approx([0.208, 0.939], abs=1e-3)
    assert found["confusion"]["gravity"] == {"play": 2, "gravity": 1, "nothing": 1}
    assert found["confusion"]["backlash + gravity"] == {"gravity": 2, "backlash": 1}
    assert found["effects"]["backlash"]["within"] == 2
    failed = [failure["session"] for failure in found["failures"]]
    # Names where nothing is, before wrong names, before silence.
    assert failed[0] in {"02", "03"}
    assert set(failed) == {"02", "03", "06", "07", "08", "09", "11", "14", "15"}
    json.dumps(found, allow_nan=False)


def with_probabilities(said, probabilities, *, evidence=None, classes=None):
    """The same verdict with a probability for each named source, and for some a log Bayes factor or a class."""
    for source in said["summary"]["sources"]:
        if source["name"] in probabilities:
            source["probability"] = probabilities[source["name"]]
            source["log_evidence"] = (evidence or {}).get(source["name"])
            source["class"] = list((classes or {}).get(source["name"], ()))
    return said


def test_three_causes_and_faint_ones_have_rows_of_their_own():
    three = [effect(name) for name in ("backlash", "gravity", "bar-drift")]
    both = {"bar-drift": ["thermal-struts"], "thermal-struts": ["bar-drift"]}
    outcomes = [
        compare(answer("01", "triple", *three), verdict("backlash", "gravity", "bar-drift")),
        compare(answer("02", "triple", *three), verdict("backlash", "gravity", declared=both)),
        compare(answer("03", "triple", *three), verdict("backlash", "gravity")),
        compare(answer("04", "triple", *three), verdict("backlash", "gravity", "bar-drift", "play")),
        # Faint ones may go unnamed; a wrong name is wrong.
        compare(answer("05", "faint", effect("gravity", 0.8)), verdict()),
        compare(answer("06", "faint", effect("gravity", 1.2)), verdict("play")),
    ]
    found = numbers(outcomes)
    hits = {title: (share["hits"], share["count"]) for title, share in found["shares"].items()}
    assert hits == {
        "triple: all named": (2, 4),
        "triple: all named or within a declared ambiguity": (3, 4),
        "triple: wrongly named": (1, 4),
        "faint: named or within a declared ambiguity": (0, 2),
        "faint: wrongly named": (1, 2),
    }
    assert found["shares"]["triple: all named or within a declared ambiguity"]["target"] == ">= 80 %"
    assert {failure["session"] for failure in found["failures"]} == {"03", "04", "06"}
    assert found["reliability"] is None


def test_perturbed_sessions_are_counted_apart():
    rough = answer("01", "single", effect("gravity")) | {"perturbed": True}
    outcomes = [compare(rough, verdict("play")), compare(answer("02", "single", effect("gravity")), verdict("gravity"))]
    table = numbers([*outcomes, compare(answer("03", "clean"), verdict())])["right_by_law"]
    assert {law: (s["hits"], s["count"]) for law, s in table.items()} == {
        "law followed roughly": (0, 1),
        "law followed exactly": (1, 1),
    }


def test_a_name_that_no_test_tells_from_the_hidden_one_is_within_and_not_wrong():
    equal = {"gravity": ("strut-weight",)}
    said = with_probabilities(verdict("gravity"), {"gravity": 0.99}, classes=equal)
    outcome = compare(answer("01", "single", effect("strut-weight")), said)
    assert (outcome.named, outcome.within, outcome.wrong) == (False, True, ())
    assert outcome.said == "gravity = strut-weight"
    assert [one.right for one in outcome.forecasts] == [True]
    assert compare(answer("02", "single", effect("play")), said).wrong == ("gravity",)
    # A class of four says too little.
    wide = {"gravity": ("strut-weight", "play", "backlash")}
    said = with_probabilities(verdict("gravity"), {"gravity": 0.99}, classes=wide)
    assert not compare(answer("03", "single", effect("strut-weight")), said).within


def test_a_class_makes_one_forecast_and_what_is_not_testable_none():
    equal = {"gravity": ("play",), "play": ("gravity",)}
    given = {"gravity": 0.6, "play": 0.97, "backlash": 0.05}
    said = with_probabilities(verdict("gravity"), given, classes=equal)
    next(s for s in said["summary"]["sources"] if s["name"] == "backlash")["verdict"] = "not-testable"
    (one,) = compare(answer("01", "single", effect("gravity")), said).forecasts
    assert (one.probability, one.right) == (0.97, True)


def test_known_probabilities_make_a_known_table():
    """One hundred verdicts said with 0.97, of which 90 are right; ten with 0.3, of which 4 are, half of them modest."""
    sure_of = [with_probabilities(verdict("gravity"), {"gravity": 0.97}, evidence={"gravity": 500.0})] * 100
    unsure = [with_probabilities(verdict(), {"gravity": 0.3}, evidence={"gravity": 3.0 + k}) for k in range(5)]
    unsure += [with_probabilities(verdict(), {"gravity": 0.3}, evidence={"gravity": -2.0})] * 5
    true = ["gravity"] * 90 + ["play"] * 10 + ["gravity", "play"] * 4 + ["play"] * 2
    said = zip(true, [*sure_of, *unsure], strict=True)
    found = numbers([compare(answer("01", "single", effect(name)), one) for name, one in said])
    whole, modest = found["reliability"].values()
    assert list(found["reliability"]) == ["all verdicts", "log Bayes factor of 3 to 20"]
    counted = {(e["from"], e["to"]): (e["hits"], e["count"]) for e in whole if e["count"]}
    assert counted == {(0.2, 0.5): (4, 10), (0.95, 1.0): (90, 100)}
    assert [e["count"] for e in modest] == [0, 0, 0, 5, 0, 0, 0]
    (certain,) = [e for e in whole if e["from"] == 0.95]
    assert certain["mean_probability"] == pytest.approx(0.97)
    # Wilson's interval of 90 in 100, by his formula with 1.96.
    assert certain["interval"] == pytest.approx([0.8256, 0.9448], abs=1e-4)
    row = found["shares"]["said with a probability of 0.95 to 1: there"]
    assert (row["hits"], row["count"], row["target"]) == (90, 100, ">= 93 %")
    json.dumps(found, allow_nan=False)


@pytest.mark.parametrize(("probability", "place"), [(0.0, 0), (0.01, 1), (0.0499, 1), (0.5, 4), (0.95, 6), (1.0, 6)])
def test_the_lower_edge_belongs_to_a_bin(probability, place):
    table = reliability([Forecast(probability, None, right=True, perturbed=False)])["all verdicts"]
    assert [entry["count"] for entry in table].index(1) == place


def test_the_diagram_shows_every_bin_with_its_count():
    said = [Forecast(0.97, 5.0, right=k < 40, perturbed=True) for k in range(43)]
    drawn = reliability_figure(reliability(said))
    texts = "".join(ET.fromstring(drawn).itertext())  # noqa: S314 - our own file
    assert texts.count("(43)") == 3
    assert texts.count("(0)") == 18
    assert "sessions with perturbed laws" in texts
    assert drawn == reliability_figure(reliability(said))


def test_an_ambiguity_counts_only_where_the_diagnosis_declares_it():
    hidden = answer("01", "single", effect("bar-drift"))
    assert not compare(hidden, verdict("thermal-struts")).within
    both = {"thermal-struts": ["bar-drift"], "bar-drift": ["thermal-struts"]}
    assert compare(hidden, verdict(declared=both)).within
    assert compare(hidden, verdict(declared=both)).wrong == ()
    # By way of a third: bar-drift or play, play or thermal-struts.
    chain = {"play": ["bar-drift", "thermal-struts"], "thermal-struts": ["play"]}
    assert compare(hidden, verdict(declared=chain)).within
    assert compare(hidden, verdict(declared=chain)).wrong == ()
    other = {"thermal-struts": ["play"], "play": ["thermal-struts"]}
    assert compare(hidden, verdict(declared=other)).wrong == ("thermal-struts", "play")


def test_errors_count_in_their_own_sigma():
    hidden = answer("01", "single", effect("backlash", amplitudes={"strut_1_um": 4.0}))
    told = verdict("backlash", parameters={"backlash": {"strut_1_um": (4.3, 0.1)}})
    assert compare(hidden, told).deviations == {"backlash strut_1_um": pytest.approx(3.0)}
    # A common height of the base joints is not seen by level bars, and not asked for.
    told = verdict(
        "backlash", shift=[("base-joints joint_2_z", 10.0, 5.0), ("strut-reference-length strut_3", -4.0, 2.0)]
    )
    assert compare(hidden, told).pulls == pytest.approx((2.0, -2.0))
    assert compare(hidden, told).held_out == pytest.approx(1.0)
    assert compare(hidden, told).gain == pytest.approx(8.0)


def test_what_nobody_can_see_may_be_named_by_its_name_only_and_at_its_size():
    faint = effect("gravity", size=0.3, amplitudes={"strut_compliance_um_kn": 0.1})
    hidden = answer("01", "concealed", faint)
    assert compare(hidden, verdict()).right
    assert not compare(hidden, verdict("play")).right
    consistent = {"gravity": {"strut_compliance_um_kn": (0.0, 0.07)}}
    assert compare(hidden, verdict(parameters=consistent)).right
    too_sure = {"gravity": {"strut_compliance_um_kn": (0.0, 0.01)}}
    assert not compare(hidden, verdict(parameters=too_sure)).right


def test_a_diagnosis_that_breaks_is_the_worst_failure():
    hidden = answer("01", "single", effect("gravity"))
    outcomes = [compare(hidden, {"error": "LinAlgError: singular", "seconds": 1.0}), compare(hidden, verdict("play"))]
    found = numbers(outcomes)
    assert found["without_a_diagnosis"] == ["01"]
    assert [failure["said"] for failure in found["failures"]] == ["LinAlgError: singular", "play"]


@pytest.fixture(scope="module", params=[8.0, pytest.param(25.0, marks=pytest.mark.nightly)])
def study(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("blind")
    answers = []
    for name, hidden in (("0001", []), ("0002", [Gravity()])):
        plan = subset(table_ii_plan(int(name)), "abho")
        truth = record(
            folder / name, plan=plan, seed=int(name), mechanisms=[RandomKinematics(), *hidden], rate_hz=request.param
        )
        effects = [effect("gravity", 90.0, amplitudes={"strut_compliance_um_kn": 9.68})] if hidden else []
        told = answer(name, "single" if hidden else "clean", *effects)
        answers.append(told | {"truth": {k: np.asarray(v).tolist() for k, v in _machine_of(truth).items()}})
    (folder / "answers.json").write_text(json.dumps({"format": "blind-answers/1", "sessions": answers}))
    return folder


def _machine_of(truth):
    return {"delta_length_mm": truth.delta_length_mm, "delta_base_mm": truth.delta_base_mm}


@pytest.mark.slow
def test_a_study_goes_on_where_it_stopped(study):
    names = ("gravity", "backlash")
    told = []
    kept = verdict_folder(study, names)
    first = judge_sessions(study, names, 1, lambda done, total: told.append((done, total)))
    assert told == [(0, 2), (1, 2), (2, 2)]
    (kept / "0002.json").unlink()
    (kept / "0001.json").write_text(json.dumps(first["0001"] | {"seconds": -1.0}))
    second = judge_sessions(study, names, 1, lambda _done, _total: None)
    assert second["0001"]["seconds"] == -1.0
    assert second["0002"]["summary"] == first["0002"]["summary"]
    found = numbers(score(read_answers(study), second))
    assert found["shares"]["single: named"]["hits"] == 1
    assert found["shares"]["clean: false alarm"]["hits"] == 0
    assert found["kinematics_in_sigma"]["rms"] < 2.0


def test_the_command_prints_the_tables(study, capsys):
    with pytest.raises(SystemExit) as left:
        main(["blind", str(study), "--candidates", "gravity,backlash", "--jobs", "1"], studies)
    assert left.value.code == 0
    printed = capsys.readouterr().out
    assert "clean: false alarm" in printed
    assert "joints and lengths" in printed


def test_the_command_draws_what_was_given_a_probability(study, tmp_path, capsys):
    names = ("gravity", "backlash")
    figure = tmp_path / "reliability.svg"
    arguments = ["blind", str(study), "--candidates", ",".join(names), "--jobs", "1", "--figure", str(figure)]
    kept = verdict_folder(study, names)
    judge_sessions(study, names, 1, lambda _done, _total: None)
    before = {path: path.read_text() for path in kept.iterdir()}
    for path in kept.iterdir():
        said = json.loads(before[path])
        for source in said["summary"]["sources"]:
            source.pop("probability", None)
        path.write_text(json.dumps(said))
    with pytest.raises(SystemExit) as left:
        main(arguments, studies)
    assert left.value.code == 1
    assert "no verdict has a probability" in capsys.readouterr().err
    assert not figure.exists()
    for path in kept.iterdir():
        said = json.loads(before[path])
        for source in said["summary"]["sources"]:
            source |= {"probability": 0.99 if source["verdict"] == "identified" else 0.004, "log_evidence": 90.0}
        path.write_text(json.dumps(said))
    with pytest.raises(SystemExit) as left:
        main(arguments, studies)
    printed = capsys.readouterr().out
    assert left.value.code == 0
    assert "probabilities of all verdicts" in printed
    assert "1 of 1" in next(line for line in printed.splitlines() if line.startswith("0.95 to 1"))
    assert ET.fromstring(figure.read_bytes()).tag.endswith("svg")  # noqa: S314 - our own file
    for path, text in before.items():
        path.write_text(text)


def test_a_folder_without_answers_says_what_is_missing(tmp_path):
    with pytest.raises(InputError, match="answers cannot be read"):
        read_answers(tmp_path)
    with pytest.raises(InputError, match="no session folders"):
        judge_sessions(tmp_path, ("gravity",), 1, lambda _done, _total: None)
