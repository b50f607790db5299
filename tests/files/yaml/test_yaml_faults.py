"""Every fault that a YAML file can have, with the place that the message names."""

from __future__ import annotations

import os
import re
from itertools import pairwise
from pathlib import Path

import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.jig import parse_jig
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml.text import load_yaml

FIXTURES = shipped_folder("fixtures")
MACHINE = (FIXTURES / "machines" / "every-key.yaml").read_text()
PLAN = (shipped_folder("protocols") / "plans" / "ten-minute-check.yaml").read_text()
CONVENTIONAL = (shipped_folder("protocols") / "plans" / "conventional.yaml").read_text()
JIG = (FIXTURES / "jigs" / "reference-plate.yaml").read_text()


def faults_of(read, path: Path, text: str | bytes) -> list[str]:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        read(path)
    return [str(problem).removeprefix(str(path)) for problem in caught.value.problems]


def place_of(text: str, needle: str) -> str:
    """`:line:column` of a needle, to be written beside the fault instead of numbers that break on every edit."""
    at = text.index(needle)
    return f":{text.count(chr(10), 0, at) + 1}:{at - text.rfind(chr(10), 0, at)}"


def changed(text: str, old: str, new: str) -> tuple[str, str]:
    assert text.count(old) >= 1
    return text.replace(old, new, 1), place_of(text, old)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"", ":1:1: the file is empty"),
        (b"# only a comment\n", ":1:1: the file is empty"),
        (b"format: dbb-plan/1\nname: \xff\n", ":2:7: byte 0xff is not UTF-8 text"),
        (b"format: dbb-plan/1\npath:\n\tradius_mm: 150\n", ":3:1: a tab is used for indentation"),
        (b"format: dbb-plan/1\nname: [1, 2\n", ":3:1: not YAML"),
        (b"format: dbb-plan/1\nname: 'x\n", ":3:1: not YAML"),
        (b"%YAML 1." + 5000 * b"1" + b"\n---\nformat: dbb-plan/1\n", ":1:1: not YAML"),
        (b"format: dbb-plan/1\n---\nname: x\n", ":2:1: a second document starts here"),
        (b"format: dbb-plan/1\nname: x\nname: y\n", ":3:1: the key `name` stands here a second time, first in line 2"),
        (b"format: dbb-plan/1\nname: \x01\n", ":2:7: character 0x01 is not allowed"),
        (b"format: dbb-plan/1\nname: !!python/none x\n", ":2:7: the tag"),
        (b"format: dbb-plan/1\n<<: {name: x}\n", ":2:1: merge keys `<<` are not allowed"),
        (b"format: dbb-plan/1\nname: &a [*a]\n", ":2:7: this alias contains itself"),
        (b"format: dbb-plan/1\nname: *nobody\n", ":2:7: not YAML: found undefined alias"),
        (b"format: dbb-plan/1\n? [1, 2]\n: 3\n", ":2:3: a key must be one word or number"),
        (b"- 1\n- 2\n", ":1:1: the file holds no `key: value` lines"),
        (b"just words\n", ":1:1: the file holds no `key: value` lines"),
        (b"name: x\n", ":1:1: the file does not say what format it has, a test plan was expected"),
        (b"format: dbb-machine/1\n", ":1:9: this file is a machine (`dbb-machine/1`), a test plan (`dbb-plan/1`) was"),
        (b"format: dbb-plan/9\n", ":1:9: `dbb-plan/9` is a version that this program does not know"),
        (b"format: dbb-plam/1\n", ":1:9: `dbb-plam/1` is no format that this program knows"),
        (b"name: x\nformat: 1\n", ":2:9: `1` is no format that this program knows"),
    ],
)
def test_files_that_are_no_plan(tmp_path: Path, text: bytes, said: str) -> None:
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert len(faults) == 1
    assert faults[0].startswith(said)


@pytest.mark.parametrize("word", ["null", "~", "true", "1.5", ".nan", "1e400"])
def test_a_key_that_would_be_no_text_as_a_value_is_a_word(tmp_path: Path, word: str) -> None:
    faults = faults_of(read_plan, tmp_path / "plan.yaml", f"format: dbb-plan/1\n{word}: 1\n".encode())
    assert any(fault.startswith(f":2:1: the key `{word}` is not known") for fault in faults)


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    for path, said in ((tmp_path / "none.yaml", "there is no such file"), (tmp_path, "this is a folder")):
        with pytest.raises(InputError, match=said):
            read_plan(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("150.0", "150000.0", "path.radius_mm: 150000 mm is not plausible, expected 20 to 2000 mm (it looks like µm)"),
        ("150.0", "0.15", "path.radius_mm: 0.15 mm is not plausible, expected 20 to 2000 mm (it looks like m)"),
        ("150.0", "5.9", "path.radius_mm: 5.9 mm is not plausible, expected 20 to 2000 mm (it looks like inch)"),
        ("150.0", "'150'", "path.radius_mm: a number was expected, not the text `150`"),
        ("150.0", "150,0", "path: the key `0` is not known"),
        ("150.0", "yes", "path.radius_mm: a number was expected, not the text `yes`"),
        ("150.0", "true", "path.radius_mm: a number was expected, not `true`"),
        ("150.0", ".nan", "path.radius_mm: a number was expected, not `nan`"),
        ("150.0", ".inf", "path.radius_mm: a number was expected, not `inf`"),
        ("150.0", "", "path.radius_mm: a number was expected, not nothing"),
        ("150.0", "[150]", "path.radius_mm: a number was expected, not a list of 1"),
        (
            "1000",
            "16.6",
            "path.feed_mm_min: 16.6 mm/min is not plausible, expected 20 to 100000 mm/min (it looks like m",
        ),
        (
            "20,",
            "0.35,",
            "path.overshoot_deg: 0.35 deg is not plausible, expected 0 or 1 to 360 deg (it looks like rad)",
        ),
        ("[ccw, cw]", "[ccw, left]", "path.directions[1]: the text `left` is not one of 'ccw' or 'cw'"),
        ("[ccw, cw]", "[cw, cw]", "path.directions: a direction stands here twice"),
        ("[ccw, cw]", "[]", "path.directions: 1 values were expected, not 0"),
        ("[ccw, cw]", "ccw", "path.directions: a list [...] was expected, not the text `ccw`"),
        ("0.58", "0.00058", "holders.short.repeatability_um: 0.00058 µm is not plausible, expected 0 or 0.01 to 1000"),
        ("low, ball", "'low one', ball", "tests[0].name: string should match pattern"),
        ("low, ball", "7, ball", "tests[0].name: text was expected, not `7`; put it in quotes"),
        ("holder: short", "holder: shirt", "balls.9-short: the holder `shirt` is not in `holders`"),
        ("{bore: 9", "{bore: 19", "balls.9-short: bore 19 is not on the jig"),
        ("{bore: 9", "{bore: nine", "balls.9-short.bore: a whole number was expected, not the text `nine`"),
        ("{bore: 3", "{bore: 4", "balls.3-long: the centre lies 100.0 mm from bore 4, at bore 3"),
        (
            "ball: 3-long",
            "ball: 3-lang",
            "tests[1]: the ball `3-lang` is not in `balls`; known: 3-long, 8-long-on-riser, 9-s",
        ),
        ("name: side", "name: low", "the test name `low` stands here a second time"),
        ("name: side", "name: LOW", "the test names `low` and `LOW` differ in case alone: Windows takes their files"),
        ("name: side", "name: Com1.a", "the test name `Com1.a` is a device on Windows, no file can be called so"),
        ("b_deg: -15", "b_deg: -15, elevation_deg: 0.0873", "tests[1].elevation_deg: 0.0873 deg is not plausible"),
        ("1: [0, 100]", "1: [0, 100, 0]", "jig.bores[1]: 2 values were expected, not 3"),
    ],
)
def test_faults_of_a_plan_with_their_places(tmp_path: Path, old: str, new: str, said: str) -> None:
    text, _ = changed(PLAN, old, new)
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    where, what = re.fullmatch(r":(\d+:\d+): (.*)", faults[0], re.DOTALL).groups()
    assert what.startswith(said)
    line, column = map(int, where.split(":"))
    changed_line = (
        next(i for i, (a, b) in enumerate(zip(PLAN.split("\n"), text.split("\n"), strict=True)) if a != b) + 1
    )
    assert line == changed_line
    assert text.split("\n")[line - 1][column - 1] not in {" ", ""} or new == ""


def test_the_column_is_that_of_the_value(tmp_path: Path) -> None:
    text, place = changed(PLAN, "150.0", "0.15")
    assert faults_of(read_plan, tmp_path / "plan.yaml", text)[0].startswith(f"{place}: path.radius_mm")


def test_an_unknown_key_names_the_nearest_and_stands_at_the_key(tmp_path: Path) -> None:
    text, place = changed(PLAN, "feed_in_mm", "feedin_mm")
    fault = faults_of(read_plan, tmp_path / "plan.yaml", text)[0]
    assert fault == f"{place}: path: the key `feedin_mm` is not known; did you mean `feed_in_mm`?"
    text, place = changed(PLAN, "b_deg: -15", "colour: red")
    fault = faults_of(read_plan, tmp_path / "plan.yaml", text)[0]
    assert fault.startswith(f"{place}: tests[1]: the key `colour` is not known; known here: a_deg, b_deg, ball")
    text, place = changed(PLAN, "repeatability_um: 1.85", "repeatability: 1.85")
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert f"{place}: holders.long: the key `repeatability` is not known; did you mean `repeatability_um`?" in faults


def test_a_missing_key_stands_at_its_mapping(tmp_path: Path) -> None:
    text, _ = changed(PLAN, "feed_mm_min: 1000, ", "")
    place = place_of(text, "{radius_mm")
    fault = faults_of(read_plan, tmp_path / "plan.yaml", text)[0]
    assert fault == f"{place}: path: the key `feed_mm_min` is missing; add it"
    text, _ = changed(PLAN, "name: Ten-minute check\n", "")
    place = place_of(text, "format:")
    assert faults_of(read_plan, tmp_path / "plan.yaml", text) == [f"{place}: the key `name` is missing; add it"]


def test_all_faults_are_reported_at_once_in_order(tmp_path: Path) -> None:
    text = PLAN
    places = []
    for old, new in (("150.0", "0.15"), ("holder: short", "holder: shirt"), ("ball: 3-long", "ball: nobody")):
        text, _ = changed(text, old, new)
        places.append(place_of(text, new.split(": ")[-1]))
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert [re.match(r":\d+:\d+", fault)[0] for fault in faults] == places


def test_a_plan_in_radians_is_caught_though_each_tilt_alone_could_be(tmp_path: Path) -> None:
    text = PLAN.replace("b_deg: -15", "b_deg: -0.2618").replace(
        "a_deg: -10, b_deg: 10", "a_deg: -0.1745, b_deg: 0.1745"
    )
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert len(faults) == 1
    assert faults[0].startswith(f"{place_of(text, '-0.2618')}: tests[1].b_deg: -0.2618 deg, and no tilt of the plan")
    assert "looks like rad" in faults[0]


def test_repeats_name_tests(tmp_path: Path) -> None:
    text = PLAN + "repeat_at_end: [low, nothing]\n"
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert faults == [
        f"{place_of(text, 'nothing')}: repeat_at_end: there is no test `nothing`; name tests of this plan"
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "-64.059470920, 732.203103097",
            "-0.064, 0.732",
            "base_joints_mm[0]: is 0.734792 mm from the origin, expected 20 ",
        ),
        (
            "xy_radius_mm: 300",
            "xy_radius_mm: 0.3",
            "travel.xy_radius_mm: 0.3 mm is not plausible, expected 5 to 10000 mm (it",
        ),
        (
            "[-26, 26]",
            "[-0.4538, 0.4538]",
            "travel.a_deg: the limits are 0.9076 deg apart, which is not plausible (it looks",
        ),
        ("[-26, 26]", "[26, -26]", "travel.a_deg: the lower limit must come first"),
        (
            "z_mm: [-1208, -808]",
            "z_mm: [-1.208, -0.808]",
            "travel.z_mm: the limits are 0.4 mm apart, which is not plausible",
        ),
        (
            "platform_kg: 400.0",
            "platform_kg: 400000.0",
            "masses.platform_kg: 400000 kg is not plausible, expected 1 to",
        ),
        ("above_tip_mm: 500.0", "above_tip_mm: 0.5", "masses.centre_of_gravity_above_tip_mm: 0.5 mm is not plausible"),
        (
            "screw_lead_mm: 10.0",
            "screw_lead_mm: 0.01",
            "screw_lead_mm: 0.01 mm is not plausible, expected 0.5 to 200 mm (it",
        ),
        ("Rz(C) Ry(B) Rx(A)", "Rz Ry Rx", "rotation: the text `Rz Ry Rx` is not one of 'Rx(A) Ry(B) Rz(C)' or 'Rz(C)"),
        (", 0.005]", "]", "reference_length_error_mm"),
        (
            "joint_tolerance_mm: 0.05",
            "joint_tolerance_mm: 50",
            "joint_tolerance_mm: 50 mm is not plausible, expected 0.0001",
        ),
    ],
)
def test_faults_of_a_machine(tmp_path: Path, old: str, new: str, said: str) -> None:
    text, _ = changed(MACHINE, old, new)
    faults = faults_of(read_machine, tmp_path / "machine.yaml", text)
    assert len(faults) == 1
    assert re.sub(r"^:\d+:\d+: ", "", faults[0]).startswith(said)


def test_a_machine_in_metres_is_caught_everywhere(tmp_path: Path) -> None:
    text = re.sub(r"(?<=[\[ ])(-?\d+\.\d{9})", lambda number: f"{float(number[0]) / 1e3:.9f}", MACHINE)
    faults = faults_of(read_machine, tmp_path / "machine.yaml", text.replace(", 500.0]", ", 0.5]"))
    assert len(faults) == 12
    assert all("it looks like m" in fault for fault in faults)


def test_a_jig_in_metres_is_caught(tmp_path: Path) -> None:
    text = re.sub(r"bores: .*", "bores: {1: [0, 0.1], 2: [-0.1, 0.1]}", JIG)
    path = tmp_path / "jig.yaml"
    path.write_text(text)
    faults = []
    parse_jig(path, faults)
    assert any("bores 1 and 2 are 0.1 mm apart" in str(fault) for fault in faults)


def test_faults_of_a_plan_and_of_its_jig_file_come_together(tmp_path: Path) -> None:
    (tmp_path / "jig.yaml").write_text(JIG.replace("holder: short", "holder: shirt", 1))
    (tmp_path / "plan.yaml").write_text(
        "format: dbb-plan/1\nname: x\npath: {radius_mm: 0.15, feed_mm_min: 1000}\njig: jig.yaml\n"
        "holders: {short: {repeatability_um: 1}}\ntests: [{name: a, ball: nobody}]\n"
    )
    with pytest.raises(InputError) as caught:
        read_plan(tmp_path / "plan.yaml")
    said = [(Path(problem.file).name, problem.line, problem.what) for problem in caught.value.problems]
    assert [(file, line) for file, line, _ in said] == [
        ("jig.yaml", place(JIG, "holder: short")),
        ("plan.yaml", 3),
        ("plan.yaml", 5),
        ("plan.yaml", 6),
    ]
    assert "holders: `short` stands in the jig file as well" in said[2][2]


def place(text: str, needle: str) -> int:
    return text.count("\n", 0, text.index(needle)) + 1


def test_a_plan_that_names_no_jig_file_that_exists(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(
        PLAN.replace("name: Ten", "name: Ten").split("jig:")[0] + "jig: none.yaml\ntests: [{name: a, ball: b}]\n"
    )
    with pytest.raises(InputError) as caught:
        read_plan(path)
    assert [Path(problem.file).name for problem in caught.value.problems] == ["none.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("a: {placed: under-spindle,", "a: {placed: under-spindle, bore: 9,", "balls.a: a ball that is put up under the spindle has no `bore`"),
        ("a: {placed: under-spindle,", "a: {placed: under-spindle, holder: short,", "balls.a: a ball that is put up under the spindle has no `holder`"),
        ("a: {placed: under-spindle,", "a: {placed: under-spindle, uncertainty_um: 0.8,", "balls.a: a ball that is put up under the spindle has no `uncertainty_um`"),
        ("a: {placed: under-spindle,", "a: {placed: under-the-spindle,", "balls.a.placed: the text `under-the-spindle` is not one of 'cmm' or 'under-spindle'"),
        ("ball: f, a_deg: 0", "ball: a, a_deg: 5", "tests[5]: the ball `a` is put up under the spindle at the tilt of test `a`; give each tilt a ball of its own"),
    ],
)  # fmt: skip
def test_faults_of_balls_under_the_spindle(tmp_path: Path, old: str, new: str, said: str) -> None:
    text, _ = changed(CONVENTIONAL, old, new)
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    where, what = re.fullmatch(r":(\d+):\d+: (.*)", faults[0], re.DOTALL).groups()
    assert what.startswith(said)
    assert new in text.split("\n")[int(where) - 1]


def test_a_bore_that_says_nothing_may_stand_at_a_ball_under_the_spindle(tmp_path: Path) -> None:
    text, _ = changed(CONVENTIONAL, "a: {placed: under-spindle,", "a: {placed: under-spindle, bore: null,")
    (tmp_path / "plan.yaml").write_text(text)
    assert not read_plan(tmp_path / "plan.yaml").tests["a"].ball.place_known


def test_a_measured_ball_needs_plate_holder_and_uncertainty(tmp_path: Path) -> None:
    text, place = changed(
        CONVENTIONAL, "{placed: under-spindle, centre_mm: [0, 0, -1150]}", "{centre_mm: [0, 0, -1150]}"
    )
    faults = faults_of(read_plan, tmp_path / "plan.yaml", text)
    assert faults == [
        (
            f"{place_of(text, 'format:')}: the key `jig` is missing; add it; only a plan that puts all its balls up under the "
            "spindle needs none"
        ),
        f"{place}: balls.a: the key `holder` is missing; add it",
        f"{place}: balls.a: the key `uncertainty_um` is missing; add it",
    ]
    text, place = changed(PLAN, "holder: short, centre_mm", "holder: null, centre_mm")
    assert faults_of(read_plan, tmp_path / "plan.yaml", text)[0].endswith(
        "balls.9-short: the key `holder` is missing; add it"
    )


def _faults(tmp_path, text):
    path, faults = tmp_path / "bomb.yaml", []
    path.write_text(text, encoding="utf-8")
    assert load_yaml(path, faults) is None
    return [fault.what for fault in faults]


def test_aliases_of_aliases_end_in_a_message(tmp_path):
    """Nine aliases of nine aliases and so on, nine deep: 387 million values."""
    lines = ["a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    for before, name in pairwise("abcdefghi"):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]")
    (what,) = _faults(tmp_path, "\n".join(lines))
    assert "250,000 values" in what


def test_brackets_without_end_end_in_a_message(tmp_path):
    assert _faults(tmp_path, "a: " + "[" * 20000) == ["brackets or lists are nested too deeply"]


@pytest.mark.parametrize(("number", "said"), [("0x" + "f" * 2000, "too large"), ("9" * 5000, "is not a number")])
def test_numbers_beyond_all_bounds_are_not_quoted_whole(tmp_path, number, said):
    (what,) = _faults(tmp_path, f"a: {number}")
    assert said in what
    assert len(what) < 150


def test_a_pipe_is_not_waited_for_and_a_device_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", Path("/dev/zero")):
        faults = []
        assert load_yaml(path, faults) is None
        assert "a pipe or a device" in faults[0].what


def test_a_file_beyond_the_limit_is_not_read(tmp_path):
    path, faults = tmp_path / "large.yaml", []
    with path.open("wb") as file:
        file.truncate(30_000_000)
    assert load_yaml(path, faults) is None
    assert "30,000,000 bytes" in faults[0].what


def test_the_same_text_in_two_files_has_the_faults_of_each(tmp_path):
    found = []
    for name in ("a.yaml", "b.yaml", "a.yaml"):
        (tmp_path / name).write_text("format: dbb-plan/1\nname: x\nname: y\n")
        load_yaml(tmp_path / name, found)
    assert [Path(fault.file).name for fault in found] == ["a.yaml", "b.yaml", "a.yaml"]
    (tmp_path / "c.yaml").write_text("name: x\n")
    (tmp_path / "d.yaml").write_text("name: x\n")
    read = [load_yaml(tmp_path / name, found) for name in ("c.yaml", "d.yaml")]
    assert [Path(one.file).name for one in read] == ["c.yaml", "d.yaml"]
