"""Run files: what is read, what is refused, and where."""

from __future__ import annotations

import hashlib
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.errors import InputError
from dbbstation.files.recordings.run_csv import parse_run, read_run

HEADER = "# test: a\n# direction: ccw\n# repeat: 1\n"
GOOD = HEADER + "t_s,length_mm\n0.0,150.1\n0.1,150.2\n0.2,150.3\n"


def parse(text: str | bytes, *, partial: bool = False):
    return parse_run(text if isinstance(text, bytes) else text.encode(), "a.csv", partial=partial)


def faults_of(text: str | bytes) -> list[str]:
    with pytest.raises(InputError) as caught:
        parse(text)
    return [str(problem) for problem in caught.value.problems]


def with_crc(lines: list[str]) -> str:
    return "".join(f"{line},{zlib.crc32(line.encode()):08x}\n" for line in lines)


def test_a_plain_run() -> None:
    run = parse(GOOD)
    assert run.header == {"test": "a", "direction": "ccw", "repeat": "1"}
    assert run.recording.t_s.tolist() == [0.0, 0.1, 0.2]
    assert run.recording.length_mm.tolist() == [150.1, 150.2, 150.3]
    assert run.recording.theta_deg is None
    assert run.recording.motor_current_a is None
    assert run.recording.usable is None
    assert run.warnings == ()


def test_every_column() -> None:
    motors = [f"motor{i}_current_a" for i in range(1, 7)]
    struts = [f"strut{i}_temp_c" for i in range(1, 7)]
    names = ["t_s", "length_mm", "theta_deg", "bar_temp_c", "jig_temp_c", "machine_temp_c", *struts, *motors, "status"]
    row = "0.5,150.1,-370.5,20.1,20.2,20.3,21,22,23,24,25,26,1,2,3,4,-5,6,overrange"
    run = parse(
        ",".join([*names, "crc"]) + "\n" + with_crc([row, row.replace("0.5,", "0.6,", 1).replace("overrange", "ok")])
    )
    recording = run.recording
    assert recording.theta_deg.tolist() == [-370.5, -370.5]
    assert {sensor: values[0] for sensor, values in recording.temperature_degc.items()} == {
        "bar": 20.1, "jig": 20.2, "machine": 20.3,
        **{f"strut{i}": 20.0 + i for i in range(1, 7)},
    }  # fmt: skip
    assert recording.motor_current_a.tolist() == [[1, 2, 3, 4, -5, 6]] * 2
    assert recording.usable.tolist() == [False, True]


def test_a_motor_that_was_not_logged_leaves_the_others_their_currents() -> None:
    names = ",".join(f"motor{i}_current_a" for i in (1, 2, 3, 4, 6))
    current = parse(f"t_s,length_mm,{names}\n0,150,1,2,3,4,6\n").recording.motor_current_a
    assert np.array_equal(current, [[1, 2, 3, 4, np.nan, 6]], equal_nan=True)
    assert parse("t_s,length_mm\n0,150\n").recording.motor_current_a is None


def test_unknown_columns_are_kept_and_named() -> None:
    run = parse("t_s,length_mm,note,status\n0,150,first,ok\n1,150,second,lost\n")
    assert run.unknown_columns == {"note": ("first", "second")}
    assert [(w.line, w.what) for w in run.warnings] == [(1, "the column `note` is not known; it is kept and not used")]
    assert run.recording.usable.tolist() == [True, False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["a.csv: the file is empty"]),
        ("\n\n", ["a.csv:2: the file is empty"]),
        (HEADER, ["a.csv:3: there is no line that names the columns"]),
        (HEADER + "t_s,length_mm\n", ["a.csv:4: there are no samples below this line"]),
        ("0.0,150.1\n", ["a.csv:1: the column `length_mm` [mm] is missing", "a.csv:1: the column `t_s` [s] is missing"]),
        ("t_s,length_um\n0,1\n", ["a.csv:1: the column `length_mm` [mm] is missing; is it `length_um`?"]),
        ("t_s,length_mm,t_s\n0,1,0\n", ["a.csv:1: the column `t_s` appears here more than once"]),
        ("t_s,crc,length_mm\n0,1,0\n", ["a.csv:1: the column `crc` must be the last"]),
        (GOOD.replace("150.2", "nan"), ["a.csv:6: length_mm is `nan`, not a finite number"]),
        (GOOD.replace("150.2", "-inf"), ["a.csv:6: length_mm is `-inf`, not a finite number"]),
        (GOOD.replace("150.2", ""), ["a.csv:6: length_mm is ``, no number"]),
        (GOOD.replace("150.2", "150,2"), ["a.csv:6: 3 values in 2 columns"]),
        (GOOD.replace("150.2", "1e999"), ["a.csv:6: length_mm is `1e999`, beyond any number"]),
        (GOOD.replace("150.2", "0x96"), ["a.csv:6: length_mm is `0x96`, no number"]),
        (GOOD.replace("150.2", "1_50"), ["a.csv:6: length_mm is `1_50`, no number"]),
        (GOOD.replace("0.1,150.2", "# 0.1,150.2"), ["a.csv:6: t_s is `# 0.1`, no number"]),
        (GOOD.replace("0.1,150.2", ""), ["a.csv:6: an empty line between samples"]),
        (GOOD.replace("0.1,150.2\n", "0.1\n150.2\n"), ["a.csv:6: 1 values in 2 columns", "a.csv:7: 1 values in 2 columns"]),
        (GOOD.replace("0.2,", "0.05,"), ["a.csv:7: time runs backwards here: t_s 0.05 after 0.1"]),
        (GOOD.replace("0.2,", "0.1,"), ["a.csv:7: time stands still here: t_s 0.1 after 0.1"]),
        (GOOD.replace("150.3", "150300"), ["a.csv:7: length_mm is 150300, sizes up to 10000 mm are plausible; check the"]),
        (GOOD.encode().replace(b"length_mm", b"length_\xb5m"), ["a.csv:4:12: byte 0xb5 is not UTF-8 text"]),
    ],
)  # fmt: skip
def test_faults_with_their_lines(text: str | bytes, said: list[str]) -> None:
    faults = faults_of(text)
    assert len(faults) == len(said)
    for fault, start in zip(faults, said, strict=True):
        assert fault.startswith(start)


def test_rows_that_were_shuffled_are_named_each() -> None:
    rows = [f"{i / 10},150.0" for i in range(10)]
    rows[3], rows[7] = rows[7], rows[3]
    faults = faults_of("t_s,length_mm\n" + "\n".join(rows) + "\n")
    assert [fault.split(": ")[0] for fault in faults] == ["a.csv:6", "a.csv:9"]


def test_very_many_faults_are_counted_not_listed() -> None:
    faults = faults_of("t_s,length_mm\n" + "x,y\n" * 1000)
    assert len(faults) == 21
    assert "980 more" in faults[-1]


@pytest.mark.parametrize("cut", range(1, 10))
def test_a_line_that_was_cut_off_costs_itself_alone(cut: int) -> None:
    run = parse(GOOD[:-cut])
    assert run.recording.length_mm.tolist() == [150.1, 150.2]
    assert [(w.line, w.what) for w in run.warnings] == [(7, "the last line was cut off; it is left out")]


def test_its_checksum_vouches_for_a_last_line_without_line_end() -> None:
    text = "t_s,length_mm,crc\n" + with_crc(["0.0,150.1", "0.1,150.2"])
    assert len(parse(text[:-1]).recording) == 2
    assert len(parse(text[:-2]).recording) == 1


def test_lines_with_a_wrong_checksum_are_named() -> None:
    text = "t_s,length_mm,crc\n" + with_crc([f"{i / 10},150.{i}" for i in range(10)])
    assert len(parse(text).recording) == 10
    assert faults_of(text.replace("150.3", "150.4")) == [
        "a.csv:5: the checksum does not match the line; the line was damaged, restore the file"
    ]
    assert "no checksum of eight hex digits" in faults_of(text.replace(",150.3,", ",150.3,x"))[0]
    assert len(faults_of(text.replace("\n0.5", "\n0.51"))) == 1


def test_line_ends_of_another_system() -> None:
    assert parse(GOOD.replace("\n", "\r\n")).recording.length_mm.tolist() == [150.1, 150.2, 150.3]


def test_a_file_that_was_changed_is_refused_by_its_hash(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(GOOD)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert len(read_run(path, sha256=digest).recording) == 3
    path.write_text(GOOD.replace("150.2", "150.4"))
    with pytest.raises(InputError, match="was changed after it was recorded"):
        read_run(path, sha256=digest)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-1e3, 1e3).map(lambda x: f"{x:.6f}"),
            st.one_of(
                st.floats(-1e3, 1e3).map(repr),
                st.sampled_from(["nan", "", " 1 ", "1e2", "+3", ".5", "5.", "١", "0x1", "1_0", "1,2", "Infinity", "1e400", "-"]),
            ),
        ),
        min_size=1,
        max_size=8,
    )
)  # fmt: skip
def test_the_quick_way_and_the_exact_way_agree(rows: list[tuple[str, str]]) -> None:
    """NumPy reads whole files, `float` reads lines to name faults: a file is good for both or for neither."""
    text = "t_s,length_mm,theta_deg\n" + "".join(f"{i},{a},{b}\n" for i, (a, b) in enumerate(rows))

    def plain(field: str) -> float | None:
        try:
            value = float(field) if field.isascii() and "_" not in field else np.nan
        except ValueError:
            return None
        return value if np.isfinite(value) else None

    expected = [plain(b) for _, b in rows]
    if any(value is None for value in expected):
        wrong = [index + 2 for index, value in enumerate(expected) if value is None]
        with pytest.raises(InputError) as caught:
            parse(text)
        assert [problem.line for problem in caught.value.problems] == wrong
    else:
        assert parse(text).recording.theta_deg.tolist() == expected


def test_recordings_made_elsewhere(recordings: Path) -> None:
    for path in (recordings / "sessions").glob("*/runs/*.csv"):
        run = read_run(path)
        assert len(run.recording) > 3000
        assert run.warnings == ()
        assert run.header["test"] == path.name.split("-")[0]
