"""Convert results to JSON and to JSON schemas."""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, GetPydanticSchema, PlainSerializer, TypeAdapter
from pydantic_core import core_schema


def _is_none(value: object) -> bool:
    return value is None


Absent = Field(exclude_if=_is_none)
"""Marks a field whose key is omitted if it is None, as in `Annotated[str | None, Absent]`."""

OrNull = Annotated[str, PlainSerializer(lambda text: text or None, return_type=str | None)]
"""A text that becomes null in JSON if empty."""

AsItIs = GetPydanticSchema(lambda _source, _handler: core_schema.any_schema())
Kept = Field(exclude=True)
"""`AsItIs` and `Kept` together mark a field of the result that its JSON omits: objects for further work."""

Array = Annotated[
    NDArray[np.float64],
    GetPydanticSchema(
        lambda _source, _handler: core_schema.any_schema(
            serialization=core_schema.plain_serializer_function_ser_schema(
                np.ndarray.tolist, return_schema=core_schema.list_schema()
            )
        )
    ),
]
"""An array of any shape; nested lists in JSON."""


_Kind = TypeVar("_Kind")

_ADAPTERS: dict[Any, TypeAdapter[Any]] = {}
"""Adapters by class, cached because each takes milliseconds to make."""


def adapter(kind: type[Any]) -> TypeAdapter[Any]:
    """Return the adapter of a class."""
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def plain(result: object) -> dict[str, Any]:
    """Return a result as dictionaries, lists, texts and numbers."""
    kind: type[Any] = type(result)
    return adapter(kind).dump_python(result, mode="json", by_alias=True)


def json_of(result: object, indent: int | None = 1, *, escaped: bool = False) -> str:
    """Return a result as JSON text.

    Raises:
        ValueError: a number is not finite.
    """
    return json.dumps(plain(result), indent=indent, allow_nan=False, ensure_ascii=escaped)


def schema_of(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a result's class."""
    return adapter(kind).json_schema(mode="serialization", by_alias=True)


def read_json(kind: type[_Kind], text: str | bytes) -> _Kind:
    """Read a dataclass from the text of `json_of`.

    Raises:
        ValueError: the text is not JSON or does not fit this class.
    """
    # pydantic's parser refuses escaped names that are not in UTF-8; Python's parser accepts them.
    return read_plain(kind, json.loads(text))


def as_objects(data: Any) -> Any:  # noqa: ANN401 - of any result
    """Return the data of `plain` as objects with attributes, for readers without the results' classes."""
    if isinstance(data, Mapping):
        return SimpleNamespace(**{name: as_objects(value) for name, value in data.items()})
    return [as_objects(value) for value in data] if isinstance(data, list) else data


def read_plain(kind: type[_Kind], data: Mapping[str, object]) -> _Kind:
    """Read a dataclass from the data of `plain`, which may come from a class with more keys.

    Args:
        data: further keys are ignored.

    Raises:
        ValueError: a key is missing, or its value is of another type.
    """
    return adapter(kind).validate_python(data)
