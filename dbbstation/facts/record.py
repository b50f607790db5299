"""Dataclasses that are parts of a file format."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from datetime import UTC, date, datetime
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainSerializer,
    WrapValidator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError, core_schema

from dbbstation.facts.serialise import adapter

STRICT = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)
"""Options of every part of a file: strict types, no unknown keys, finite numbers; the text under a field states unit and sign."""


class Record:
    """Base of dataclasses that are their own schema. Reading a file checks them, but constructing them in a program does not."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    @classmethod
    def __get_pydantic_core_schema__(cls, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        # A strict dataclass accepts no mapping by default; its fields remain strict.
        inner: Any = schema["schema"] if schema["type"] == "definitions" else schema
        inner["strict"] = False
        return schema

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        found = handler(schema)
        part = handler.resolve_ref_schema(found)
        part["description"] = inspect.cleandoc(cls.__doc__ or "")
        for base in cls.__bases__:  # pydantic reads the texts under a class's own fields only
            inherited = adapter(base).json_schema()["properties"] if base is not Record else {}
            for name, said in inherited.items():
                part["properties"][name] |= {"description": said["description"]}
        return found


@dataclass(frozen=True)
class AsArray:
    """Marks an array that a file stores as a tuple of this kind."""

    kind: Any

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(
            lambda given, check: given if isinstance(given, np.ndarray) else np.array(check(given)),
            handler.generate_schema(self.kind),
            serialization=core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist),
        )


def _moment(given: object) -> object:
    if isinstance(given, datetime):
        return given
    if not isinstance(given, str):
        raise PydanticKnownError("string_type")
    try:
        moment = datetime.fromisoformat(given)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise PydanticCustomError(
            "moment", "`{text}` is not a time with its zone, such as 2026-11-20T08:04:11Z", {"text": given}
        )
    return moment


def _day(text: str) -> str:
    try:
        date.fromisoformat(text)
    except ValueError:
        raise PydanticCustomError("day", "`{text}` is not a date", {"text": text}) from None
    return text


Moment = Annotated[
    datetime,
    BeforeValidator(_moment),
    PlainSerializer(lambda moment: moment.astimezone(UTC).isoformat().replace("+00:00", "Z"), return_type=str),
]
Day = Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$"), AfterValidator(_day)]
Sha256Hex = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_null_is_empty = WrapValidator(lambda text, check: "" if text is None else check(text))
LEFT_OUT_EMPTY = Field(exclude_if=lambda value: not value)
"""Marks a field whose key is omitted if it is empty."""
OrEmpty = Annotated[str, _null_is_empty, LEFT_OUT_EMPTY]
"""A text that is empty if its key is absent."""
Sha256OrEmpty = Annotated[Sha256Hex, _null_is_empty, LEFT_OUT_EMPTY]
