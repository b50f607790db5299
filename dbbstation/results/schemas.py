"""JSON Schemas of commands' results."""

from __future__ import annotations

from typing import Any

from dbbstation.facts.serialise import schema_of
from dbbstation.results.calibration import CalibrationResult, EvaluationResult
from dbbstation.results.checked import CheckResult
from dbbstation.results.circles import CirclesResult
from dbbstation.results.comparison import ComparisonResult
from dbbstation.results.control import KinematicsResult, ParametersResult
from dbbstation.results.diagnosis import DiagnosisResult
from dbbstation.results.drive import DriveResult
from dbbstation.results.exchange import ExportResult, ImportResult
from dbbstation.results.fleet import FleetResult
from dbbstation.results.history import HistoryResult
from dbbstation.results.instruments import InstrumentsResult
from dbbstation.results.jig import HoldersResult, SheetResult
from dbbstation.results.mismatch import MismatchResult
from dbbstation.results.prediction import PredictionResult
from dbbstation.results.programs import ProgramsResult
from dbbstation.results.report import ReportResult
from dbbstation.results.sessions import ListedSession, MeasuredSession, SessionEvents, SimulatedSession
from dbbstation.results.settings import SettingsResult
from dbbstation.results.simulator import SimulatorResult
from dbbstation.results.sources import SourcesResult

RESULTS: dict[str, type] = {
    "calibrate": CalibrationResult,
    "check": CheckResult,
    "circles": CirclesResult,
    "compare": ComparisonResult,
    "compensate": ProgramsResult,
    "diagnose": DiagnosisResult,
    "identify": DriveResult,
    "evaluate": EvaluationResult,
    "export": ExportResult,
    "fleet": FleetResult,
    "history": HistoryResult,
    "import": ImportResult,
    "instrument-list": InstrumentsResult,
    "jig-holders": HoldersResult,
    "jig-sheet": SheetResult,
    "measure": MeasuredSession,
    "mismatch": MismatchResult,
    "mismatch-simulator": SimulatorResult,
    "predict": PredictionResult,
    "program": ProgramsResult,
    "report": ReportResult,
    "session-list": ListedSession,
    "control-kinematics": KinematicsResult,
    "control-parameters": ParametersResult,
    "session-log": SessionEvents,
    "settings": SettingsResult,
    "simulate": SimulatedSession,
    "sources": SourcesResult,
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
    """Return the JSON Schema of a command's `--json`.

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
