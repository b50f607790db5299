from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InputError, InstrumentError
from dbbstation.instrument.codec import decode, encode
from dbbstation.instrument.library import instruments_folder, known_instruments, load_instrument, read_protocol

if TYPE_CHECKING:
    from pathlib import Path

GOOD = r"""format: dbb-instrument/1
name: gauge
title: A gauge
line: {baud: 9600}
ask: {mode: latch, request: "?"}
length: {unit: mm, range_mm: [0, 100]}
frames:
  - parts:
      - {kind: decimal, width: 8, decimals: 3}
      - {kind: literal, value: "\r"}
timing: {timeout_s: 1}
"""


def faults_of(tmp_path: Path, text: str) -> str:
    file = tmp_path / "gauge.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_protocol(file)
    return str(caught.value).replace(f"{tmp_path}/", "")


def test_both_shipped_instruments_load() -> None:
    assert {"heidenhain-nd281b", "streaming-encoder"} <= set(known_instruments())
    for name in known_instruments():
        assert load_instrument(name).name == name
    assert instruments_folder().is_dir()


def test_the_line_of_the_nd281b() -> None:
    protocol = load_instrument("heidenhain-nd281b")
    assert protocol.line.text == "9600 baud, 7 data bits, even parity, 2 stop bits"
    assert protocol.ask.request == b"\x02"
    # The manual counts 187 bits for a reply.
    assert protocol.frame_characters * protocol.line.bits_per_character == 187
    assert protocol.fastest_hz() == pytest.approx(14.0, abs=0.1)


def test_a_name_that_is_not_known_brings_the_nearest() -> None:
    with pytest.raises(
        InstrumentError, match="no instrument is called 'heidenhain-nd281'; did you mean heidenhain-nd281b"
    ):
        load_instrument("heidenhain-nd281")
    with pytest.raises(
        InstrumentError, match=r"known are heidenhain-nd281b, heidenhain-nd287.*; or give the path of your own file"
    ):
        load_instrument("zzz")


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("baud: 9600", "baudd: 9600", "gauge.yaml:4:8: line: the key `baudd` is not known; did you mean `baud`?"),
        ("timeout_s: 1", "timeout_s: soon", "gauge.yaml:11:21: timing.timeout_s: a number was expected"),
        ("name: gauge", "name: other", "gauge.yaml:2:7: the name 'other' is not the file's; rename the file"),
        ("mode: latch", "mode: stream", "gauge.yaml:5:6: ask: modes poll and latch have request bytes"),
        ("[0, 100]", "[100, 0]", "length: range_mm is [lowest, highest]"),
        ("unit: mm", "unit: count", "length: give mm_per_count with the unit count only"),
        ('value: "\\r"', 'value: "\u20ac"', "characters on a wire are bytes"),
        ("width: 8, ", "", "every frame ends in the same literal"),
        ("kind: decimal, width: 8, decimals: 3", "kind: skip, written: x", "a frame without a length is a message"),
        ('"?"', "'V\\r'", r"`\r` is two characters here: escapes need double quotes"),
        ("kind: decimal", "kind: decimals", "kind `decimals` is not known; did you mean `decimal`?"),
        ("format: dbb-instrument/1", "format: dbb-plan/1", "gauge.yaml:1:9: format: "),
    ],
)
def test_a_wrong_file_is_refused_with_the_place(tmp_path: Path, old: str, new: str, fault: str) -> None:
    assert old in GOOD
    text = GOOD.replace(old, new)
    if old.startswith("width"):
        text = text.replace('      - {kind: literal, value: "\\r"}\n', "")
    assert fault in faults_of(tmp_path, text)


def test_a_list_is_not_short_for_a_fault_of_its_item(tmp_path: Path) -> None:
    assert "values were expected" not in faults_of(tmp_path, GOOD.replace("kind: decimal", "kind: decimals"))


def test_every_fault_is_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("baud: 9600", "baud: fast").replace("timeout_s: 1", "timeout_s: -1")
    assert faults_of(tmp_path, text).count("gauge.yaml:") == 2


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml"):
        load_instrument(tmp_path / "none.yaml")


def test_the_instruments_need_nothing_of_ours_but_errors_and_files() -> None:
    code = (
        "import sys, dbbstation.instrument.driver, dbbstation.instrument.replay; "
        "print(*{name.split('.')[1] for name in sys.modules if name.startswith('dbbstation.')})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    # Faults are listed as people count, which is in `text`; `facts` has the base of the parts of files.
    assert set(done.stdout.split()) == {"catalogue", "errors", "facts", "files", "instrument", "system", "text"}


@pytest.mark.parametrize(
    ("added", "fault"),
    [
        ("profiles: {x: {title: x, line: {baud: -1}}}", "gauge.yaml:12:39: line.baud: "),
        ("profiles: {x: {title: x, lenght: {unit: mm}}}", "the key `lenght` is not known; did you mean `length`?"),
        ('profiles: {x: {title: x, ask: {request: ""}}}', "modes poll and latch have request bytes"),
        ("profiles: {X: {title: x}}", "profiles.X"),
        ("profiles: {x: {title: x, length: {range_mm: [5, 1]}}}", "range_mm is [lowest, highest]"),
    ],
)
def test_every_profile_is_checked_when_the_file_is_read(tmp_path: Path, added: str, fault: str) -> None:
    assert fault in faults_of(tmp_path, f"{GOOD}{added}\n")


@pytest.mark.parametrize(
    ("frame", "fault"),
    [
        (
            "{status: fault, means: x, bare: true, parts: [{kind: text, written: x}]}",
            "a bare frame has fixed bytes only",
        ),
        (
            '{status: fault, means: x, parts: [{kind: errors, codes: [{code: "1", means: x, status: ok}]}]}',
            "an error has a status that is not ok",
        ),
        (
            '{status: fault, means: x, parts: [{kind: text, width: 2, written: xyz}, {kind: literal, value: "\\r"}]}',
            "fit into the width",
        ),
        ("{status: fault, means: x, parts: [{kind: text, written: x}]}", "every frame ends in the same literal"),
    ],
)
def test_frames_that_make_no_sense_are_refused(tmp_path: Path, frame: str, fault: str) -> None:
    assert fault in faults_of(tmp_path, GOOD.replace("timing:", f"  - {frame}\ntiming:"))


def test_a_number_may_stand_for_more_than_its_digits(tmp_path: Path) -> None:
    text = GOOD.replace("width: 8, decimals: 3", 'width: 9, pad: "0", scale: 0.0001')
    (tmp_path / "gauge.yaml").write_text(text, encoding="utf-8")
    protocol = read_protocol(tmp_path / "gauge.yaml")
    assert encode(protocol, 15.00031) == b"000150003\r"
    assert decode(protocol, b"000150003\r").length_mm == 15.0003


def test_bounds_of_the_latch_stand_instead_of_its_delay(tmp_path: Path) -> None:
    both = GOOD.replace("timeout_s: 1", "timeout_s: 1, latch_delay_s: 0.1, latch_bounds_s: [0, 0.1]")
    assert "leave latch_delay_s out" in faults_of(tmp_path, both)
    assert "[earliest, latest]" in faults_of(
        tmp_path, GOOD.replace("timeout_s: 1", "timeout_s: 1, latch_bounds_s: [0.2, 0.1]")
    )
