"""Write plain data as readable YAML with exact numbers."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

_ONE_LINE, _ONE_LINE_IN_LIST = 140, 500
"""Longest mapping on one line; entries of a list may be longer, so that columns line up."""

_PLAIN = re.compile(
    r"[A-Za-z]([A-Za-z0-9 ._/()+-]*[A-Za-z0-9_/()+-])?"
    r"|\d+-[A-Za-z][A-Za-z0-9-]*"
    r"|\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z"
    r"|(?=[0-9e]*[a-df])[0-9a-f]{64}"
)
_MISREAD = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}
_NEEDS_ESCAPE = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


def yaml_text(data: Mapping[str, object]) -> str:
    """Return a document of plain data as YAML."""
    return "\n".join(_block(data, "")) + "\n"


def _block(data: Mapping[str, object] | Sequence[object], indent: str) -> list[str]:
    lines: list[str] = []
    if isinstance(data, Mapping):
        for key, value in data.items():
            if _on_one_line(value, in_list=False):
                lines.append(f"{indent}{_flow(key)}: {_flow(value)}")
            else:
                lines += [f"{indent}{_flow(key)}:", *_block(value, indent + "  ")]  # type: ignore[arg-type]
        return lines
    for value in data:
        if _on_one_line(value, in_list=True):
            lines.append(f"{indent}- {_flow(value)}")
        else:
            first, *rest = _block(value, indent + "  ")  # type: ignore[arg-type]
            lines += [f"{indent}- {first.lstrip()}", *rest]
    return lines


def _on_one_line(value: object, *, in_list: bool) -> bool:
    if not _is_container(value):
        return True
    items = list(value.values() if isinstance(value, Mapping) else value)  # type: ignore[call-overload]
    if not items or (isinstance(value, Sequence) and not any(map(_is_container, items))):
        return True
    if isinstance(value, Sequence) and any(isinstance(item, Mapping) for item in items):
        return False
    if any(isinstance(item, Sequence) and any(map(_is_container, item)) for item in items if _is_container(item)):
        return False
    longest = _ONE_LINE_IN_LIST if in_list and isinstance(value, Mapping) else _ONE_LINE
    return len(_flow(value)) <= longest


def _is_container(value: object) -> bool:
    return isinstance(value, Mapping | Sequence | np.ndarray) and not isinstance(value, str)


def _flow(value: object) -> str:  # noqa: PLR0911 - one kind of value each
    if isinstance(value, str):
        return _text(value)
    if value is None:
        return "null"
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return _number(float(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence | np.ndarray):
        return "[" + ", ".join(map(_flow, value)) + "]"
    raise TypeError(f"{type(value).__name__} cannot be written into a file")


def _number(value: float) -> str:
    if math.isfinite(value):
        return repr(value)
    return ".nan" if math.isnan(value) else (".inf" if value > 0 else "-.inf")


def _text(value: str) -> str:
    if _PLAIN.fullmatch(value) and value.lower() not in _MISREAD:
        return value
    quoted = json.dumps(value, ensure_ascii=False)
    return _NEEDS_ESCAPE.sub(lambda found: f"\\u{ord(found[0]):04x}", quoted)
