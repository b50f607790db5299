"""What commands print as JSON is what their JSON Schema says."""

from __future__ import annotations

import json

from tests.cli.json_schema import faults


def test_a_wrong_document_is_noticed(run):
    schema = json.loads(run("check", "--schema", "predict").out)
    found = faults({"poses": "two", "more": 1}, schema, schema.get("$defs", {}))
    assert ".poses: 'two' is no integer" in found
    assert ": more is not in the schema" in found
    assert ": error_rms_um is missing" in found


def test_a_command_without_a_schema_is_said(run):
    outcome = run("check", "--schema", "calibrat")
    assert outcome.code == 2
    assert "dbb-plan/1" in outcome.err
    assert "calibrate" in outcome.err
