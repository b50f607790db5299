"""Every YAML format with its schema, and the JSON Schema that editors and other programs take."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.files.jig_file import JigFile
from dbbstation.files.machine_file import MachineFile
from dbbstation.files.model_file import ModelFile
from dbbstation.files.plan_file import PlanFile
from dbbstation.files.schema import format_of
from dbbstation.files.session_file import SessionFile

if TYPE_CHECKING:
    from dbbstation.files.schema import Schema

SCHEMAS: dict[str, type[Schema]] = {
    format_of(schema): schema for schema in (JigFile, MachineFile, ModelFile, PlanFile, SessionFile)
}
"""Schema of each format by its name with version."""


def json_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a format, units and plausible ranges included.

    Raises:
        KeyError: no format has this name.
    """
    schema = SCHEMAS[name].model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": name}
