"""`dbbstation sources`: every cause can be looked up, with what a machine gives it."""

from __future__ import annotations

import json

import pytest

from dbbstation.cli import main
from dbbstation.files.formats.machine import read_machine
from dbbstation.sources.registry import known_sources
from tests.station.bench import MACHINE_FILE


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        main(["sources", *map(str, arguments)])
    out, err = capsys.readouterr()
    return left.value.code, out, err


def test_the_list_has_every_cause_once(capsys):
    code, out, _ = run(capsys)
    assert code == 0
    titles, *rows = out.splitlines()
    assert titles.split()[0] == "cause"
    assert [row.split()[0] for row in rows] == list(known_sources())


@pytest.mark.parametrize("name", known_sources())
def test_each_says_what_it_is_in_text_and_in_json(capsys, name):
    told = json.loads(run(capsys, name, "--json")[1])
    code, out, _ = run(capsys, name)
    assert code == 0
    together = " ".join(out.split())
    source = known_sources()[name]
    for key in ("what", "shows", "confirm", "cure", "equation", "origin"):
        assert told[key] == getattr(source.texts, key)
        assert " ".join(told[key].split()) in together
    assert told["form_uncertainty"] == source.form_uncertainty
    assert all(len(line) <= 110 for line in out.splitlines())


def test_with_a_machine_it_prints_the_parameters(capsys):
    told = json.loads(run(capsys, "backlash", "--machine", MACHINE_FILE, "--json")[1])
    expected = known_sources()["backlash"].parameters(read_machine(MACHINE_FILE))
    assert [p["name"] for p in told["parameters"]] == [p.name for p in expected]
    assert "strut_3_um, usually" in run(capsys, "backlash", "--machine", MACHINE_FILE)[1]


def test_a_name_that_nobody_knows_is_answered_with_the_nearest(capsys):
    code, out, err = run(capsys, "backlsh")
    assert code == 1
    assert not out
    assert "did you mean backlash?" in err
