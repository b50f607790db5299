"""What is written reads back as it was, whatever it holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.text import parse_yaml

TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=20)
LIKE_OTHERS = st.sampled_from(
    ["", "null", "~", "yes", "On", "no", "n", "1", "-1", "1e3", ".5", "0x1f", "1:30", "2026-11-20", "- a", "a: b", "#", "a #b",
     "[", "{a", "&a", "*a", "!x", "%", "@", "`", "'", '"', " a", "a ", "a\nb", "\t", "=", "<<", "?", "9-short", "c0" * 32, "1" * 64]
)  # fmt: skip
SCALAR = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.floats(allow_nan=False).map(np.float64), TEXT, LIKE_OTHERS
)  # fmt: skip
VALUE = st.recursive(
    SCALAR,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.one_of(TEXT, LIKE_OTHERS, st.integers(0, 99)), inner, max_size=4),
    ),
    max_leaves=20,
)
DATA = st.dictionaries(st.one_of(TEXT, LIKE_OTHERS), VALUE, min_size=1, max_size=5)


def tuples(value: object) -> object:
    if isinstance(value, dict):
        return {key: tuples(item) for key, item in value.items()}
    return tuple(map(tuples, value)) if isinstance(value, list) else value


@settings(max_examples=100, deadline=None)
@given(DATA)
@example({"a": {}, "b": [], "c": [[]], "d": [{}]})
@example({"a": [[{"b": [[1]]}]]})
@example({"": "\x85\u2028\ufeff\x7f\U0001f600"})
def test_any_data_reads_back(data: dict[str, object]) -> None:
    reads_back(data)


@pytest.mark.nightly
@settings(max_examples=1000, deadline=None)
@given(DATA)
def test_much_data_reads_back(data: dict[str, object]) -> None:
    reads_back(data)


def reads_back(data: dict[str, object]) -> None:
    text = yaml_text(data)
    faults = []
    document = parse_yaml(text, "x.yaml", faults)
    assert not faults
    assert document.data == tuples(data)
    plain = YAML(typ="safe", pure=True).load(text)
    if not any(isinstance(key, str) and key in {"=", "<<"} for key in data):
        assert set(plain) == set(data)


@given(st.floats())
def test_every_number_reads_back_to_the_last_bit(value: float) -> None:
    read = parse_yaml(yaml_text({"x": value}), "x.yaml", []).data["x"]
    assert isinstance(read, float)
    assert read == value or (math.isnan(read) and math.isnan(value))
    assert math.copysign(1.0, read) == math.copysign(1.0, value) or math.isnan(value)


def test_what_has_no_place_in_a_file() -> None:
    with pytest.raises(TypeError, match="set cannot be written into a file"):
        yaml_text({"x": {1, 2}})


def test_it_looks_as_people_write_it() -> None:
    data = {
        "format": "dbb-plan/1",
        "path": {"radius_mm": 150.0, "directions": ["ccw", "cw"]},
        "tests": [{"name": "a", "ball": "9-short", "a_deg": 0.0}, {"name": "n", "note": "it's: fine"}],
        "array": np.array([1.5, 2.5]),
    }
    assert yaml_text(data) == (
        "format: dbb-plan/1\n"
        "path: {radius_mm: 150.0, directions: [ccw, cw]}\n"
        "tests:\n"
        "  - {name: a, ball: 9-short, a_deg: 0.0}\n"
        '  - {name: "n", note: "it\'s: fine"}\n'
        "array: [1.5, 2.5]\n"
    )
