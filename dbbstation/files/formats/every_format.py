"""Every YAML format with its schema and JSON Schema."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.facts.serialise import adapter
from dbbstation.files.formats.bar import BarFile
from dbbstation.files.formats.jig import JigFile
from dbbstation.files.formats.job import JobFile
from dbbstation.files.formats.machine import MachineFile
from dbbstation.files.formats.mapping import MappingFile
from dbbstation.files.formats.model_schema import ModelFile
from dbbstation.files.formats.plan import PlanFile
from dbbstation.files.formats.session import SessionFile
from dbbstation.files.formats.settings_schema import SettingsFile
from dbbstation.files.formats.simulator import SimulatorFile
from dbbstation.files.yaml.schema import format_of

if TYPE_CHECKING:
    from dbbstation.facts.record import Record
    from dbbstation.files.yaml.schema import Schema

_SCHEMAS = (
    BarFile,
    JigFile,
    JobFile,
    MachineFile,
    MappingFile,
    ModelFile,
    PlanFile,
    SessionFile,
    SettingsFile,
    SimulatorFile,
)

SCHEMAS: dict[str, type[Schema | Record]] = {format_of(schema): schema for schema in _SCHEMAS}
"""Schema of each format, by name with version."""


def json_schema(name: str, schema: type[Schema | Record]) -> dict[str, object]:
    """Return the JSON Schema of a format such as `dbb-plan/1`, with units and plausible ranges."""
    described = adapter(schema).json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **described, "title": name}
