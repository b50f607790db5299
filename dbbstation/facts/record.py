"""Dataclasses that are parts of a file format."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, date, datetime
from functools import cache
from itertools import pairwise
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
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError, core_schema

from dbbstation.facts.quantities import complaint

STRICT = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
"""Options of every part of a file: strict types, no unknown keys, finite numbers."""


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
        describe(part["properties"], [base for base in cls.__mro__ if issubclass(base, Record)])
        return found


def describe(properties: JsonSchemaValue, classes: Iterable[type]) -> None:
    """Add to the properties of a JSON schema the texts under the fields of its classes, which state unit and sign."""
    # pydantic itself reads the texts when a class is made, which each start of the program would wait for.
    for one in classes:
        for name, text in _texts_under_fields(one.__module__).get(one.__name__, {}).items():
            extras = getattr(inspect.get_annotations(one, eval_str=True)[name], "__metadata__", ())
            alias = next((extra.alias for extra in extras if isinstance(extra, FieldInfo) and extra.alias), name)
            properties.get(alias, {}).setdefault("description", text)


@cache
def _texts_under_fields(module: str) -> dict[str, dict[str, str]]:
    """Return the texts under the fields of a module's classes, by class and field."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {
        one.name: {
            field.target.id: inspect.cleandoc(text.value.value)
            for field, text in pairwise(one.body)
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
        }
        for one in tree.body
        if isinstance(one, ast.ClassDef)
    }


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
        raise complaint(f"`{given}` is not a time with its zone, such as 2026-11-20T08:04:11Z")
    return moment


def _day(text: str) -> str:
    try:
        date.fromisoformat(text)
    except ValueError:
        raise complaint(f"`{text}` is not a date") from None
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
