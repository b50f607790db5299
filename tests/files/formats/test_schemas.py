"""Each format has a schema that says unit and sign, and an example that uses all of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dbbstation.files.checking import SCHEMAS, json_schema
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml.schema import FORMATS, keys_at
from dbbstation.files.yaml.text import load_yaml

FIXTURES = shipped_folder("fixtures")
SESSIONS = FIXTURES / "sessions"
EXAMPLES = {
    "dbb-machine/1": [FIXTURES / "machines" / "every-key.yaml"],
    "dbb-jig/1": [FIXTURES / "jigs" / "reference-plate.yaml"],
    "dbb-job/1": [FIXTURES / "jobs" / name for name in ("daily-check.yaml", "virtual.yaml")],
    "dbb-plan/1": [FIXTURES / "plans" / "every-key.yaml"],
    "dbb-settings/1": [FIXTURES / "settings" / "every-key.yaml"],
    "dbb-mapping/1": [FIXTURES / "mappings" / "every-key.yaml"],
    "dbb-simulator/1": [
        *(FIXTURES / "simulators" / name for name in ("pendulum.yaml", "tank.yaml")),
        Path(__file__).parents[2] / "simulators" / "tank-fmu.yaml",
    ],
    "dbb-bar/1": [FIXTURES / "bars" / "zerodur.yaml"],
    "dbb-model/1": [FIXTURES / "models" / "every-key.yaml"],
    "dbb-session/1": [SESSIONS / name / "session.yaml" for name in ("virtual", "logged", "begun", "under-spindle")],
}
UNITS = ("_mm", "_deg", "_um", "_kg", "_temp_c", "_mm_min", "_um_m_k", "_mm_per_n")


def test_every_format_has_schema_and_example() -> None:
    assert set(SCHEMAS) == set(EXAMPLES)
    assert {name.partition("/")[0] for name in SCHEMAS} == set(FORMATS)


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_field_says_what_it_is_and_in_which_unit(name: str) -> None:
    schema = json_schema(name, SCHEMAS[name])
    for part in (schema, *schema["$defs"].values()):
        for key, field in part.get("properties", {}).items():
            if "$ref" in field:  # pydantic leaves its text out beside a default
                continue
            assert field.get("description"), f"{part['title']}.{key}"
            if key.endswith(UNITS):
                assert "[" in field["description"], f"{part['title']}.{key} names no unit"


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_json_schema_is_plain_json_and_closed(name: str) -> None:
    schema = json.loads(json.dumps(json_schema(name, SCHEMAS[name])))
    assert schema["title"] == name
    assert schema["additionalProperties"] is False
    for part in schema["$defs"].values():
        assert part.get("additionalProperties") is False or "enum" in part


SHOWN_BESIDE = {
    ("dbb-session/1", "bar"): {
        "calibrator_certificate",
        "calibrator_certified",
        "calibrator_valid_until",
        "ball_form_um",
    },
    ("dbb-model/1", "provenance"): {"virtual"},
}
"""Keys that the example of a bar shows, and one that would call an example computed."""


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_examples_use_every_key(name: str) -> None:
    faults = []
    documents = [load_yaml(path, faults) for path in EXAMPLES[name]]
    assert not faults
    used: dict[tuple[str, ...], set[str]] = {}
    known: dict[tuple[str, ...], set[str]] = {}

    def visit(location: tuple, general: tuple[str, ...], data: object) -> None:
        if isinstance(data, dict):
            known.setdefault(general, set()).update(keys_at(SCHEMAS[name], location))
            used.setdefault(general, set()).update(map(str, data))
            free = not known[general]
            for key, value in data.items():
                visit((*location, key), (*general, "*" if free else key), value)
        elif isinstance(data, tuple):
            for index, value in enumerate(data):
                visit((*location, index), (*general, "*"), value)

    for document in documents:
        visit((), (), document.data)
    for general, keys in known.items():
        # The machine of a model has an example of its own.
        if not name.startswith("dbb-model/") or general[:1] != ("machine",):
            assert keys - SHOWN_BESIDE.get((name, *general), set()) <= used[general], ".".join(general)
