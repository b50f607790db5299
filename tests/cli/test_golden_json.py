"""Keys of `--json` stay: what every command prints has the keys, types and words that the committed files say."""

from __future__ import annotations

import json

import pytest

from dbbstation.results.schemas import RESULTS
from dbbstation.service.work import SessionTask
from dbbstation.tui.results_screen import result_lines
from tests.cli.golden_json import GOLDEN, keys_of, lines_of, without_place
from tests.cli.json_schema import faults
from tests.once import OF_SESSIONS, OF_TABLES, computed_once


@pytest.fixture(scope="module")
def printed(tmp_path_factory, run):
    """Keys of what every command printed, by the name of its golden file; in their order, since some take what others wrote."""
    lines = lines_of(tmp_path_factory.mktemp("golden"))
    with pytest.MonkeyPatch.context() as patch:
        computed_once(tmp_path_factory, patch, *OF_SESSIONS, *OF_TABLES)
        return {name: run(*arguments, "--json") for name, arguments in lines.items()}


@pytest.mark.slow
def test_every_command_prints_the_keys_that_others_rely_on(printed):
    failed = {name: outcome.err for name, outcome in printed.items() if outcome.code != 0}
    assert failed == {}
    found = {name: keys_of(without_place(outcome.data)) for name, outcome in printed.items()}
    assert sorted(found) == sorted(path.stem for path in GOLDEN.glob("*.txt"))
    for name, keys in found.items():
        assert keys.splitlines() == (GOLDEN / f"{name}.txt").read_text(encoding="utf-8").splitlines(), name


@pytest.mark.slow
def test_every_command_prints_what_its_schema_says(printed, run):
    schemas = {name: json.loads(run("check", "--schema", name).out) for name in sorted(set(RESULTS) & set(printed))}
    assert set(schemas) == set(printed)
    found = {name: faults(printed[name].data, schema, schema.get("$defs", {})) for name, schema in schemas.items()}
    assert found == {name: [] for name in schemas}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "step"),
    [
        ("calibrate", SessionTask.CALIBRATE),
        ("diagnose", SessionTask.DIAGNOSE),
        ("program", SessionTask.PROGRAMS),
        ("report", SessionTask.REPORT),
        ("report", SessionTask.ACCEPTANCE),
    ],
)
def test_what_the_station_shows_is_printed(printed, command, step):
    assert all(result_lines(step, printed[command].data))


def test_a_key_that_is_renamed_is_noticed():
    assert keys_of({"runs": [{"g_um": 1.0}]}) != keys_of({"runs": [{"g_mm": 1.0}]})
    assert keys_of({"unit": "µm"}) != keys_of({"unit": "mm"})
