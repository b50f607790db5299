"""JSON Schemas of what commands print as JSON."""

from __future__ import annotations

from typing import Any

from dbbstation.results.calibration import CalibrationResult
from dbbstation.results.circles import CirclesResult
from dbbstation.results.comparison import ComparisonResult
from dbbstation.results.diagnosis import DiagnosisResult
from dbbstation.results.drive import DriveResult
from dbbstation.results.evaluation import EvaluationResult
from dbbstation.results.fleet import FleetResult
from dbbstation.results.history import HistoryResult
from dbbstation.results.mismatch import MismatchResult
from dbbstation.results.prediction import PredictionResult
from dbbstation.results.programs import ProgramsResult
from dbbstation.results.serialise import schema_of

RESULTS: dict[str, type] = {
    "calibrate": CalibrationResult,
    "circles": CirclesResult,
    "compare": ComparisonResult,
    "compensate": ProgramsResult,
    "diagnose": DiagnosisResult,
    "drive": DriveResult,
    "evaluate": EvaluationResult,
    "fleet": FleetResult,
    "history": HistoryResult,
    "mismatch": MismatchResult,
    "predict": PredictionResult,
    "program": ProgramsResult,
}
"""Class of each command's result, by the command's name."""

_PROVENANCE = {
    "type": "object",
    "description": "where the output comes from: program, command and SHA-256 of every input by name",
    "properties": {
        "program": {"type": "string"},
        "command": {"type": "string"},
        "inputs": {"type": "object", "additionalProperties": {"type": "string"}},
    },
    "required": ["program", "command", "inputs"],
}


def result_schema(command: str) -> dict[str, Any]:
    """Return the JSON Schema of what a command prints with `--json`.

    Args:
        command: its name.

    Raises:
        KeyError: the command has none.
    """
    schema = schema_of(RESULTS[command])
    properties = {**schema["properties"], "provenance": _PROVENANCE}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": f"dbbstation {command} --json",
        "properties": properties,
        "required": [*schema["required"], "provenance"],
    }
