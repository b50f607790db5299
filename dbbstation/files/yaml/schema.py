"""Common base of schemas, strict and frozen; faults become problems with a position."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from inspect import get_annotations
from pathlib import Path
from typing import Any, ClassVar, Self, TypeAlias, TypeVar, get_type_hints

from pydantic import (
    BaseModel,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails

from dbbstation.catalogue import meant
from dbbstation.errors import MOST_FAULTS, Problem, few
from dbbstation.facts.quantities import complaint
from dbbstation.facts.record import STRICT, Record, describe
from dbbstation.facts.serialise import adapter
from dbbstation.files.source_text import shortened
from dbbstation.files.yaml.text import Location, YamlDocument, load_yaml

FORMATS = {
    "dbb-session": "a session",
    "dbb-machine": "a machine",
    "dbb-plan": "a test plan",
    "dbb-jig": "a jig",
    "dbb-model": "a model",
    "dbb-settings": "a shop's settings",
    "dbb-bar": "the calibration of a bar",
    "dbb-job": "a job",
    "dbb-mapping": "the mapping of recordings made elsewhere",
    "dbb-simulator": "a simulator of one's own",
}
"""Names of the formats in messages, by the name before the version."""


BEFORE_FIRST = "24b5a22b"
"""Commit that reads files from before the first release, in formats with a version of 2 or more."""


Rules: TypeAlias = Iterable[tuple[object, str]]
"""Rules of valid keys together: whether one is broken, and the sentence about it."""


class Schema(BaseModel):
    """Base of every part of a file format; the docstring under each field states its unit and sign."""

    model_config = STRICT
    replaced: ClassVar["type[Schema] | None"] = None
    """Part of a format whose keys these replace."""

    def _rules(self) -> Rules:
        """Return the rules in order; only the first broken one is reported."""
        return ()

    @model_validator(mode="after")
    def _obeys_rules(self) -> Self:
        for broken, what in self._rules():
            if broken:
                raise complaint(what)
        return self

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        found = handler(schema)
        classes = (cls.replaced or cls).__mro__
        describe(
            handler.resolve_ref_schema(found).get("properties", {}), [one for one in classes if issubclass(one, Schema)]
        )
        return found


@dataclass(frozen=True)
class Partly:
    """Marks keys of another part of a format, all of which may be absent; required combinations are checked elsewhere."""

    part: type[Schema]

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        bases = [one for one in reversed(self.part.__mro__) if issubclass(one, Schema)]
        # Not `get_type_hints`, which needs the names of what pydantic declares for type checkers only.
        kinds = {name: kind for one in bases for name, kind in get_annotations(one, eval_str=True).items()}
        keys: Any = {key: (kinds[key] | None, None) for key in self.part.model_fields}
        said = f"Keys that replace those of: {self.part.__doc__}"
        made: Any = create_model(f"{self.part.__name__}Instead", __base__=Schema, __doc__=said, **keys)
        made.replaced = self.part
        return handler.generate_schema(made | None)


S = TypeVar("S", bound=Schema | Record)


def read_document(path: Path, schema: type[Schema | Record], faults: list[Problem]) -> YamlDocument | None:
    """Read a YAML file by `schema`; None with faults added."""
    document = load_yaml(path, faults)
    if document is None:
        return None
    if not isinstance(document.data, dict):
        what = "the file holds no `key: value` lines"
        document.fault((), what, "compare it with the example of its format")
        return None
    return document if _has_format(document, format_of(schema)) else None


def validate(document: YamlDocument, schema: type[S], folder: Path | None = None) -> S | None:
    """Return a document validated by its schema; None with faults added to those of the document.

    Args:
        folder: to which the document's paths are relative.
    """
    try:
        return adapter(schema).validate_python(document.data, context=folder)
    except ValidationError as error:
        # Naming what a key may have been meant for takes a millisecond: for the first few only.
        every = error.errors(include_url=False)
        inside = {detail["loc"][:depth] for detail in every for depth in range(len(detail["loc"]))}
        # A list is too short where its items have faults, which are told.
        details = [one for one in every if one["type"] != "too_short" or one["loc"] not in inside]
        details.sort(key=lambda detail: _place(document, detail))
        first = [_problem(document, schema, detail) for detail in details[: MOST_FAULTS + 1]]
        document.faults.extend(few(first, len(details)))
        return None


def read_valid(path: Path, schema: type[S], faults: list[Problem]) -> tuple[YamlDocument, S] | None:
    """Read a YAML file by `schema` and validate it; None with faults added."""
    document = read_document(path, schema, faults)  # type: ignore[arg-type]  # a class of the union
    found = None if document is None else validate(document, schema)
    return None if document is None or found is None else (document, found)


def format_of(schema: type[Schema | Record]) -> str:
    """Return the name of a format with its version, such as `dbb-plan/1`."""
    return str(get_type_hints(schema)["format"].__args__[0])


def _has_format(document: YamlDocument, expected: str) -> bool:
    name = expected.partition("/")[0]
    wanted = FORMATS[name]
    if "format" not in document.data:
        what = f"the file does not say what format it has, {wanted} was expected"
        document.fault((), what, f"begin it with `format: {expected}`")
        return False
    given = document.data["format"]
    if given == expected:
        return True
    given_name = str(given).partition("/")[0]
    if given_name == name:
        what = f"`{shortened(str(given))}` is a version that this program does not know"
        remedy = f"it reads {expected}; a newer dbbstation may read the file, commit {BEFORE_FIRST} one of before the first release"
    elif given_name in FORMATS:
        what = f"this file is {FORMATS[given_name]} (`{shortened(str(given))}`), {wanted} (`{expected}`) was expected"
        remedy = "check which file is given where"
    else:
        what, remedy = f"`{shortened(str(given))}` is no format that this program knows", f"write `format: {expected}`"
    document.fault(("format",), what, remedy)
    return False


def _problem(document: YamlDocument, schema: type[Any], detail: ErrorDetails) -> Problem:
    location = _known_part(document, detail["loc"])
    kind, given, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "missing":
        missing = str(detail["loc"][-1])
        return document.problem(location, f"{_within(location)}the key `{missing}` is missing", "add it")
    if kind in {"extra_forbidden", "invalid_key", "unexpected_keyword_argument"}:
        allowed = list(keys_at(schema, location[:-1]))
        remedy = meant(str(location[-1]), allowed, f"known here: {', '.join(sorted(allowed))}")
        what = f"{_within(location[:-1])}the key `{shortened(str(location[-1]))}` is not known"
        return document.problem(location, what, remedy, at_key=True)
    what, remedy = _in_words(kind, given, context, detail["msg"])
    return document.problem(location, f"{dotted(location)}: {what}", remedy)


def _in_words(kind: str, given: object, context: dict[str, Any], message: str) -> tuple[str, str]:  # noqa: PLR0911
    if kind in {"float_type", "int_type", "int_from_float", "finite_number"}:
        number = "a whole number" if kind.startswith("int") else "a number"
        return f"{number} was expected, not {_shown(given)}", "write digits with a dot as decimal sign"
    if kind == "string_type":
        remedy = "put it in quotes" if isinstance(given, int | float) else "write one word or text in quotes"
        return f"text was expected, not {_shown(given)}", remedy
    if kind in {"literal_error", "enum"}:
        return f"{_shown(given)} is not one of {context['expected']}", "use one of these"
    if kind in {"tuple_type", "list_type"}:
        return f"a list [...] was expected, not {_shown(given)}", "put the values in brackets"
    if kind in {"model_type", "dict_type", "model_attributes_type", "dataclass_type"}:
        return f"`key: value` entries were expected, not {_shown(given)}", "compare it with the example of its format"
    if kind in {"too_long", "too_short"}:
        limit = context.get("max_length", context.get("min_length"))
        return f"{limit} values were expected, not {context['actual_length']}", "check the list"
    if kind == "union_tag_invalid":
        known = context["expected_tags"].replace("'", "").split(", ")
        remedy = meant(context["tag"], known, f"known here: {', '.join(known)}")
        return f"{context['discriminator'].strip(chr(39))} `{shortened(context['tag'])}` is not known", remedy
    if kind == "implausible":
        return message, "check the unit"
    return message[:1].lower() + message[1:], ""


def _place(document: YamlDocument, detail: ErrorDetails) -> tuple[int, int]:
    location = _known_part(document, detail["loc"])
    return document.key_places.get(location) or document.value_places.get(location, (0, 0))


def dotted(location: Location) -> str:
    """Return a location as text, such as `tests[3].ball`."""
    text = ""
    for step in location:
        text += f"[{step}]" if isinstance(step, int) else f".{shortened(step)}" if text else shortened(step)
    return text


def _within(location: Location) -> str:
    return f"{dotted(location)}: " if location else ""


def _shown(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, dict | tuple):
        return "`key: value` entries" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, str):
        return f"the text `{shortened(value)}`"
    return f"`{str(value).lower() if isinstance(value, bool) else shortened(str(value))}`"


def _known_part(document: YamlDocument, location: tuple[int | str, ...]) -> Location:
    known: Location = ()
    for step in location:
        if (*known, step) in document.value_places:
            known = (*known, step)
    return known


def keys_at(schema: type[Schema | Record], location: Location) -> Iterator[str]:
    """Return the keys of a schema at a location."""
    root = adapter(schema).json_schema()
    definitions = root.get("$defs", {})

    def alternatives(part: dict[str, Any]) -> list[dict[str, Any]]:
        if "$ref" in part:
            return alternatives(definitions[part["$ref"].rsplit("/", maxsplit=1)[-1]])
        options = part.get("anyOf") or part.get("oneOf")
        return [found for option in options for found in alternatives(option)] if options else [part]

    parts = alternatives(root)
    for step in location:
        inner: list[dict[str, Any]] = []
        for part in parts:
            if isinstance(step, int) and "prefixItems" in part:
                inner += part["prefixItems"][step : step + 1]
            inner += [part[name] for name in ("items", "additionalProperties") if isinstance(part.get(name), dict)]
            inner += part.get("patternProperties", {}).values()
            inner += [part["properties"][step]] if step in part.get("properties", {}) else []
        parts = [found for option in inner for found in alternatives(option)]
    for part in parts:
        yield from part.get("properties", {})
