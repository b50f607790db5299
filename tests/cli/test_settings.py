"""The shop's settings: where they are found, what they give to commands, who wins, what is refused."""

from __future__ import annotations

import os
import re
import shutil

import pytest

from dbbstation.cli import DONE, FAILED, USAGE, session_options
from dbbstation.cli.session_options import RecordingOptions
from dbbstation.cli.settings import built_in
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.settings import read_settings
from dbbstation.files.formats.settings_schema import SettingsFile
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml.text import load_yaml
from dbbstation.plan.tolerance import CircleFigure, Tolerance, worst

EVERY_KEY = shipped_folder("fixtures") / "settings" / "every-key.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
HEAD = "format: dbb-settings/1\n"


@pytest.fixture
def shop(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "config" / "dbbstation").mkdir(parents=True)
    (tmp_path / "shop").mkdir()
    monkeypatch.chdir(tmp_path / "shop")
    return tmp_path / "shop"


def write(path, text):
    path.write_text(HEAD + text, encoding="utf-8")
    return path


def beside(shop, text):
    return write(shop / "dbbstation-settings.yaml", text)


def of_user(shop, text):
    return write(shop.parent / "config" / "dbbstation" / "settings.yaml", text)


def test_the_example_has_every_key():
    found = read_settings([EVERY_KEY])
    assert set(found.values) == set(built_in())
    figures = [CircleFigure.CIRCULAR_DEVIATION, CircleFigure.CENTRE_DEVIATION, CircleFigure.CIRCULAR_HYSTERESIS]
    assert [one.figure for one in found.tolerances] == figures
    assert [one.upr for one in found.tolerances] == [30, 30, 50]
    assert found.tolerances[1].largest_um == 20.0  # 0.02 mm
    assert load_yaml(EVERY_KEY, []).data.keys() == SettingsFile.model_fields.keys()


def test_every_value_says_its_line():
    lines = EVERY_KEY.read_text(encoding="utf-8").splitlines()
    for key, setting in read_settings([EVERY_KEY]).values.items():
        assert lines[setting.line - 1].strip().startswith(key.rpartition(".")[2] + ":")


def test_the_template_is_a_settings_file_and_with_its_marks_taken_away_the_example(run, shop):
    template = run("settings", "--template").out
    path = shop / "template.yaml"
    path.write_text(template, encoding="utf-8")
    assert read_settings([path]).values == {}
    assert run("check", path).code == DONE
    path.write_text(re.sub(r"^#(?=[a-z]|  )", "", template, flags=re.MULTILINE), encoding="utf-8")
    assert {k: s.value for k, s in read_settings([path]).values.items()} == {
        k: s.value for k, s in read_settings([EVERY_KEY]).values.items()
    }


@pytest.mark.usefixtures("shop")
def test_without_a_file_the_programs_own_values_hold(run):
    outcome = run("settings", "--json")
    assert outcome.data["files"] == []
    assert outcome.data["values"]["limits.largest_correction_mm"] == {"value": 1.0, "from": "dbbstation"}
    assert outcome.data["values"]["port"] == {"value": None, "from": None}
    assert "--template" in run("settings").err


def test_the_file_beside_the_session_holds_over_the_users(run, shop):
    near = beside(shop, "port: /dev/near\nlimits: {largest_correction_mm: 0.3}\n")
    far = of_user(
        shop, "port: /dev/far\nbaud: 9600\nlimits:\n  largest_correction_mm: 0.4\n  largest_loss_percent: 2.0\n"
    )
    values = run("settings", "--json").data["values"]
    assert values["port"] == {"value": "/dev/near", "from": f"{near}:2"}
    assert values["baud"] == {"value": 9600, "from": f"{far}:3"}
    assert values["limits.largest_correction_mm"] == {"value": 0.3, "from": f"{near}:3"}
    assert values["limits.largest_loss_percent"] == {"value": 2.0, "from": f"{far}:6"}
    shown = run("settings").out
    assert re.search(rf"^port +/dev/near +{re.escape(str(near))}:2$", shown, re.MULTILINE)
    assert re.search(r"^program.step_deg +0.1 +dbbstation$", shown, re.MULTILINE)


def test_beside_means_the_folder_that_holds_the_session(run, shop, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    write(tmp_path / "elsewhere" / "dbbstation-settings.yaml", "port: /dev/there\n")
    beside(shop, "port: /dev/here\n")
    assert run("settings", tmp_path / "elsewhere" / "session", "--json").data["values"]["port"]["value"] == "/dev/there"
    assert run("settings", "--json").data["values"]["port"]["value"] == "/dev/here"


@pytest.mark.parametrize("place", ["before", "after", "equals"])
def test_a_file_that_is_named_is_read_alone_wherever_the_option_stands(run, shop, place):
    beside(shop, "port: /dev/near\nbaud: 9600\n")
    own = write(shop / "own.yaml", "port: /dev/own\n")
    named = {
        "before": ["--settings", own, "settings", "--json"],
        "after": ["settings", "--json", "--settings", own],
        "equals": ["settings", f"--settings={own}", "--json"],
    }[place]
    data = run(*named).data
    assert data["files"] == [str(own)]
    assert data["values"]["port"]["value"] == "/dev/own"
    assert data["values"]["baud"]["value"] is None


def test_two_files_make_no_bar_of_their_parts(run, shop):
    beside(shop, "bar: {calibrated_length_mm: 100.0, calibrator_uncertainty_mm: 0.001}\n")
    of_user(shop, "bar: {serial_number: DBB-1, calibrated_length_mm: 150.0, calibrator_uncertainty_mm: 0.0005}\n")
    values = run("settings", "--json").data["values"]
    assert values["bar.calibrated_length_mm"]["value"] == 100.0
    assert values["bar.serial_number"]["value"] is None


MEASURE = ("measure", "--plan", PLAN, "--machine", MACHINE, "--out", "session", "--bar-waiver", "no bar here")


def test_measure_takes_instrument_port_and_bar_and_says_so(run, shop):
    near = beside(
        shop,
        "instrument: heidenhain-nd281b\nport: no-port\n"
        "bar: {calibrated_length_mm: 150.0003, calibrator_uncertainty_mm: 0.0005}\n",
    )
    outcome = run(*MEASURE)
    assert outcome.code == FAILED
    assert "no-port" in outcome.err.splitlines()[-1]  # it got as far as opening the port
    assert outcome.err.splitlines()[0] == (
        "settings: --instrument heidenhain-nd281b, --port no-port, --bar-length-mm 150.0003, --bar-uncertainty-um 0.5 "
        f"(from {near})"
    )


def test_an_option_wins(run, shop):
    beside(shop, "instrument: heidenhain-nd281b\nport: no-port\n")
    outcome = run(*MEASURE, "--port", "other-port")
    assert "other-port" in outcome.err.splitlines()[-1]
    assert "no-port" not in outcome.err


def test_an_option_about_the_bar_sets_the_whole_bar_aside(run, shop):
    beside(
        shop,
        "instrument: heidenhain-nd281b\nport: no-port\n"
        "bar: {calibrated_length_mm: 150.0003, calibrator_uncertainty_mm: 0.0005}\n",
    )
    outcome = run(*MEASURE, "--bar-serial-number", "DBB-9")
    assert outcome.code == USAGE
    assert "a bar needs --bar-length-mm and --bar-uncertainty-um" in outcome.err


def test_a_bar_that_cannot_run_the_plan_is_refused(run, shop):
    beside(
        shop,
        "instrument: heidenhain-nd281b\nport: no-port\n"
        "bar: {calibrated_length_mm: 100.0, calibrator_uncertainty_mm: 0.0005}\n",
    )
    outcome = run(*MEASURE)
    assert outcome.code == FAILED
    assert "bar of 100 mm" in outcome.err


@pytest.mark.usefixtures("shop")
def test_without_settings_the_options_are_required(run):
    outcome = run(*MEASURE)
    assert outcome.code == USAGE
    assert "--instrument" in outcome.err


def test_a_protocol_file_is_found_from_the_settings_folder(run, shop, tmp_path):
    text = (shipped_folder("protocols") / "instruments" / "heidenhain-nd281b.yaml").read_text(encoding="utf-8")
    (shop / "gauge.yaml").write_text(text.replace("name: heidenhain-nd281b", "name: gauge"), encoding="utf-8")
    write(shop / "own.yaml", "instrument: gauge.yaml\nport: no-port\n")
    os.chdir(tmp_path)
    outcome = run("--settings", shop / "own.yaml", "instrument", "monitor")
    assert outcome.code == FAILED
    assert "no-port" in outcome.err.splitlines()[-1]


def test_programs_take_limit_and_steps(run, shop):
    """A turn with 45 degrees more on either side in steps of one degree, and five moves before and after it."""
    beside(shop, "program: {step_deg: 1.0}\nlimits: {largest_correction_mm: 0.01}\n")
    nominal = ("program", "--plan", PLAN, "--machine", MACHINE, "--tests", "a", "--json")
    outcome = run(*nominal, "--out", "nominal")
    assert outcome.code == DONE, outcome.err
    points = {each["points"] for each in outcome.data["programs"]}
    assert points == {450 + 5}
    assert "settings: --step-deg 1.0, --largest-correction-mm 0.01" in outcome.err
    refused = run(*nominal, "--out", "compensated", "--model", MODEL)
    assert refused.code == FAILED
    assert "0.01 mm" in refused.err.splitlines()[-1]
    allowed = run(*nominal, "--out", "compensated", "--model", MODEL, "--largest-correction-mm", "1")
    assert allowed.code == DONE, allowed.err


def test_a_loss_limit_goes_into_the_plan_that_has_none(monkeypatch):
    silent = read_inline_plan(PLAN)
    assert silent.largest_loss_percent is None
    stating = read_inline_plan(shipped_folder("fixtures") / "plans" / "every-key.yaml")
    own = stating.largest_loss_percent
    assert own not in {None, 2.0}
    for of_settings, of_stating in ((True, own), (False, 2.0)):
        monkeypatch.setattr(session_options, "from_settings", lambda _, answer=of_settings: answer)
        two, none = RecordingOptions(largest_loss_percent=2.0), RecordingOptions()
        assert two.in_force(silent).to_domain().largest_loss_percent == 2.0
        assert two.in_force(stating).largest_loss_percent == of_stating
        assert none.in_force(stating).largest_loss_percent == own


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_table_with_decimal_commas(run, shop, separator):
    name = {";": '";"', "\t": '"\\t"'}[separator]
    beside(shop, f'numbers: {{decimal: ",", separator: {name}}}\n')
    titles = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"]
    german = ["100,5", "0", "-1008,25", "1,5", "0", "0"]
    (shop / "german.csv").write_text(f"{separator.join(titles)}\n{separator.join(german)}\n", encoding="utf-8")
    plain = ",".join(cell.replace(",", ".") for cell in german)
    (shop / "plain.csv").write_text(f"{','.join(titles)}\n{plain}\n", encoding="utf-8")
    assert run("predict", "--model", MODEL, "german.csv", "--table", "one.csv").code == DONE
    write(shop / "none.yaml", "")
    assert run("--settings", "none.yaml", "predict", "--model", MODEL, "plain.csv", "--table", "two.csv").code == DONE
    assert (shop / "one.csv").read_text() == (shop / "two.csv").read_text()


def test_a_number_in_the_other_language_is_refused_and_never_read_as_another(run, shop):
    """1.500 is fifteen hundred to some and one and a half to others."""
    beside(shop, 'numbers: {decimal: ","}\n')
    (shop / "poses.csv").write_text("x_mm;y_mm;z_mm;a_deg;b_deg;c_deg\n1.500;0;-1008;0;0;0\n", encoding="utf-8")
    outcome = run("predict", "--model", MODEL, "poses.csv", "--table", "out.csv")
    assert outcome.code == FAILED
    assert "poses.csv:2: x_mm is `1.500`, not a finite number; " in outcome.err
    assert "the decimal sign is a comma" in outcome.err


BAD = {
    "prot: /dev/ttyUSB0\n": ":2:1: the key `prot` is not known; did you mean `port`?",
    "port: 3\n": ":2:7: port: text was expected, not `3`; put it in quotes",
    "baud: fast\n": ":2:7: baud: a whole number was expected, not the text `fast`",
    "bar: {calibrated_length_mm: 0.15, calibrator_uncertainty_mm: 0.0005}\n": "(it looks like m); check the unit",
    "bar: {serial_number: A}\n": "bar: the key `calibrated_length_mm` is missing; add it",
    "limits: {largest_correction_mm: 30.0}\n": "30 mm is not plausible, expected 0.001 to 10 mm",
    'numbers: {decimal: ",", separator: ","}\n': "decimal sign and separator are both a comma; give `;` or a tab",
    "tolerances: [{quantity: roundness, largest: 1.0, unit: µm}]\n": "the text `roundness` is not one of 'circular-deviation'",
    "tolerances: [{quantity: circular-deviation, largest: 8.0, unit: um}]\n": "the text `um` is not one of 'µm'",
    "tolerances: [{quantity: circular-deviation, largest: 8.0, unit: mm}]\n": "8000 µm is not plausible",
}


@pytest.mark.parametrize("text", BAD)
def test_a_fault_is_named_with_its_place_by_every_command_that_reads_it(run, shop, text):
    path = beside(shop, text)
    for words in (("check", path), ("settings",), ("evaluate", "session", "--model", MODEL), MEASURE):
        outcome = run(*words)
        assert outcome.code == FAILED
        assert outcome.err.startswith(f"{path}:2:")
        assert BAD[text] in outcome.err


@pytest.mark.usefixtures("shop")
def test_a_file_that_is_not_there(run):
    outcome = run("--settings", "nowhere.yaml", "settings")
    assert outcome.code == FAILED
    assert "nowhere.yaml: there is no such file; check the path" in outcome.err


def test_help_asks_no_settings(run, shop):
    beside(shop, "prot: 1\n")
    assert run("measure", "--help").code == DONE


def test_the_worst_run_of_a_tolerance():
    def runs(*sizes):
        return [
            ("a", "ccw", 1, {CircleFigure.MEAN_RADIAL_ERROR: sizes[0]}),
            ("b", "cw", 2, {CircleFigure.MEAN_RADIAL_ERROR: sizes[1]}),
        ]

    every = Tolerance(CircleFigure.MEAN_RADIAL_ERROR, 5.0)
    found = worst(every, runs(4.0, -6.0))
    assert (found.run, found.size_um, found.within) == ("b-cw-2", 6.0, False)
    assert worst(every, runs(4.0, -5.0)).within  # what is as large as the limit is within
    assert worst(Tolerance(CircleFigure.MEAN_RADIAL_ERROR, 5.0, ("a",)), runs(4.0, -6.0)).within
    assert worst(Tolerance(CircleFigure.MEAN_RADIAL_ERROR, 5.0, ("c",)), runs(4.0, -6.0)) is None


def test_evaluate_holds_circles_against_tolerances(run, shop, fifteen, model):
    shutil.copytree(fifteen, shop / "session")
    runs = run("evaluate", "session", "--model", model, "--json").data["runs"]
    largest = max(runs, key=lambda one: one["circularity_30_upr_um"]["before"])
    size = largest["circularity_30_upr_um"]["before"]
    near = beside(
        shop,
        f"tolerances:\n  - {{quantity: circular-deviation, largest: {size - 0.1:.4f}, unit: µm}}\n"
        f"  - {{quantity: circular-deviation, largest: {(size + 0.1) / 1000:.7f}, unit: mm}}\n"
        "  - {quantity: centre-deviation, largest: 1.0, unit: µm, tests: [zz]}\n",
    )
    outcome = run("evaluate", "session", "--model", model, "--json")
    first, second, third = outcome.data["tolerances"]
    assert first["before"]["run"] == f"{largest['test']}-{largest['direction']}-{largest['repeat']}"
    assert (first["before"]["within"], second["before"]["within"]) == (False, True)
    assert first["after"]["within"]
    assert third["before"] is None
    shown = run("evaluate", "session", "--model", model).out
    assert f"tolerances [µm], from {near}:2" in shown
    assert "EXCEEDED" in shown
    assert "no such run" in shown
