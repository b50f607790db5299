"""Convert YAML text to plain data, with the line and column of every key and value.

ruamel.yaml composes nodes. Only YAML 1.2 scalars are accepted, without tags, merge keys or double keys. Sequences
become tuples; times remain text.
"""

from __future__ import annotations

import functools
import re
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, StreamMark, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.parser import Parser
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.scanner import Scanner

from dbbstation.errors import Faults, Problem, few
from dbbstation.files.source_text import shortened, text_in

if TYPE_CHECKING:
    from pathlib import Path

Location = tuple[str | int, ...]
"""Keys and indices from the top of a document down to a value."""

_TAG = "tag:yaml.org,2002:"
_HALF = re.compile("[\ud800-\udfff]")
_PLAIN_TEXT = {"str", "timestamp", "value"}


@dataclass(frozen=True)
class YamlDocument:
    """A YAML file's data with their positions.

    Attributes:
        data: mappings, tuples, text, numbers, booleans and None.
        value_places: (line, column), from 1, of each value's start.
        key_places: (line, column), from 1, of each key's start.
    """

    file: str
    data: Any
    value_places: dict[Location, tuple[int, int]] = field(repr=False)
    key_places: dict[Location, tuple[int, int]] = field(repr=False)
    faults: list[Problem] = field(default_factory=list, repr=False, compare=False)

    def problem(self, location: Location, what: str, remedy: str = "", *, at_key: bool = False) -> Problem:
        """Return a problem at a value or its key, or at the nearest existing parent."""
        if at_key and location in self.key_places:
            return Problem(self.file, *self.key_places[location], what, remedy)
        around = location
        while around and around not in self.value_places:
            around = around[:-1]
        return Problem(self.file, *self.value_places.get(around, (1, 1)), what, remedy)

    def fault(self, location: Location, what: str, remedy: str = "", *, at_key: bool = False) -> None:
        """Add the problem of a key or value to the faults."""
        self.faults.append(self.problem(location, what, remedy, at_key=at_key))

    def entries(self, *location: str | int) -> list[tuple[Location, dict[Any, Any]]]:
        """Return the mappings in a sequence or mapping; empty for other types.

        So checks across entries work even if the file has other faults.
        """
        within = self.data
        for step in location:
            within = within.get(step) if isinstance(within, dict) else None
        pairs = within.items() if isinstance(within, dict) else enumerate(within if isinstance(within, tuple) else ())
        return [((*location, key), entry) for key, entry in pairs if isinstance(entry, dict)]


LARGEST_BYTES = 10_000_000
"""Largest YAML file that is read [bytes]: twice the size of `MOST_NODES` numbers of full precision."""

MOST_NODES = 250_000
"""Greatest number of keys and values of a document, as in a model with 490 parameters and their covariance, or in a
session of ten thousand runs. Both are ten times larger than any recorded ones. Reading them needs ten seconds and 250
MB."""

MOST_VALUES = MOST_NODES
"""Greatest number of values with all aliases expanded: nested aliases would fill any memory."""

DEEPEST = 50
"""Greatest depth of nested lists and mappings; the formats have eight."""

SHORT = 10_000
"""Greatest number of characters of a parsed text that stays in memory, with 63 other texts: usually 5 MB, at most 60 MB."""

LONGEST_TAG = 1000
"""Greatest number of characters of a tag. Tags are refused, but each is first read to its end."""

LONGEST_S = 60.0
"""Longest time of reading a document [s]: six times the time for `MOST_NODES`, for a slow computer."""


def load_yaml(path: Path, faults: list[Problem]) -> YamlDocument | None:
    """Read a YAML file; None with reasons added to `faults`."""
    text = text_in(path, faults, LARGEST_BYTES)
    return None if text is None else parse_yaml(text, str(path), faults)


def parse_yaml(text: str, file: str, faults: list[Problem]) -> YamlDocument | None:
    """Parse YAML text; None with reasons added to `faults`."""
    document, found = (_of_many if len(text) <= SHORT else _of_the_last)(text)
    faults += [replace(fault, file=file) for fault in found]
    return None if document is None else replace(document, file=file, faults=faults)


def _parsed(text: str) -> tuple[YamlDocument | None, tuple[Problem, ...]]:
    faults = Faults("")
    return _composed(text, faults), tuple(faults)


# A file is read twice at once: for its format and for its content. Every run and program reads its plan, machine and instrument.
_of_the_last = functools.lru_cache(maxsize=1)(_parsed)
_of_many = functools.lru_cache(maxsize=64)(_parsed)


def _composed(text: str, faults: Faults) -> YamlDocument | None:
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _Counting
    yaml.Scanner, yaml.Parser = _BoundedScanner, _Parser
    try:
        root = yaml.compose(text)
    except YAMLError as error:
        _tell_syntax(error, text, faults)
        return None
    except ValueError as error:  # a version of YAML with a thousand digits
        faults.add(f"not YAML: {error}", "compare it with the example of its format", 1, 1)
        return None
    except _OverBudgetError as error:
        faults.add(error.what, "check that it is the right file", *error.place)
        return None
    if root is None:
        faults.add("the file is empty", "start it with `format: ` and the format's name", 1, 1)
        return None
    walk = _Walk()
    data = walk.value(root, ())
    if walk.faults:
        faults.extend(few(walk.faults))
        return None
    return YamlDocument("", data, walk.value_places, walk.key_places)


class _OverBudgetError(Exception):
    """A document exceeds a budget at a line and column, from 1."""

    def __init__(self, what: str, mark: StreamMark) -> None:
        super().__init__(what)
        self.what = what
        self.place = (mark.line + 1, mark.column + 1)


class _BoundedScanner(Scanner):
    """Refuses overlong tags, for which ruamel.yaml needs quadratic time."""

    def scan_tag(self) -> Any:  # noqa: ANN401 - as in ruamel.yaml
        if not self.reader.prefix(LONGEST_TAG).split(maxsplit=1)[0][LONGEST_TAG - 1 :]:
            return super().scan_tag()
        raise _OverBudgetError(f"a tag has more than {LONGEST_TAG:,} characters", self.reader.get_mark())

    def need_more_tokens(self) -> bool:
        # Asked several times a token; without a place where a key may have begun there is nothing to look for.
        return super().need_more_tokens() if self.possible_simple_keys else not (self.done or self.tokens)


class _Parser(Parser):
    """Looks up its scanner and resolver once, not at every token: a seventh of the time."""

    scanner = functools.cached_property(vars(Parser)["scanner"].fget)
    resolver = functools.cached_property(vars(Parser)["resolver"].fget)


class _Counting(Composer):
    """Counts nodes, depth and time while composing, before memory fills."""

    parser = functools.cached_property(vars(Composer)["parser"].fget)
    resolver = functools.cached_property(vars(Composer)["resolver"].fget)

    def __init__(self, loader: Any = None) -> None:  # noqa: ANN401 - a class of ruamel.yaml without a name of its own
        super().__init__(loader)
        self._nodes = 0
        self._depth = 0
        self._until_s = time.monotonic() + LONGEST_S

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:  # noqa: ANN401 - as in ruamel.yaml
        mark = self.parser.peek_event().start_mark
        self._nodes += 1
        self._depth += 1
        if self._nodes > MOST_NODES:
            raise _OverBudgetError(f"there are more than {MOST_NODES:,} keys and values", mark)
        if self._depth > DEEPEST:
            raise _OverBudgetError("brackets or lists are nested too deeply", mark)
        if time.monotonic() > self._until_s:
            raise _OverBudgetError(f"reading this far took {LONGEST_S:g} s", mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


def _tell_syntax(error: YAMLError, text: str, faults: Faults) -> None:
    if isinstance(error, ReaderError):
        before = text[: error.position]
        line, column = before.count("\n") + 1, error.position - (before.rfind("\n") + 1) + 1
        faults.add(f"character {error.character:#04x} is not allowed", "remove it", line, column)
        return
    mark = error.problem_mark if isinstance(error, MarkedYAMLError) else None
    if not isinstance(error, MarkedYAMLError) or mark is None:
        faults.add(f"not YAML: {error}", "compare it with the example of its format")
        return
    place = (mark.line + 1, mark.column + 1)
    said = error.problem or ""
    if "'\\t'" in said:
        faults.add("a tab is used for indentation", "indent with spaces", *place)
    elif "another document" in said:
        faults.add("a second document starts here", "keep one document per file, remove `---`", *place)
    else:
        faults.add(f"not YAML: {said}", "check brackets, quotes and indentation here and just above", *place)


class _Walk:
    """Turns nodes into data and notes their places."""

    def __init__(self) -> None:
        self.faults = Faults("")
        self.value_places: dict[Location, tuple[int, int]] = {}
        self.key_places: dict[Location, tuple[int, int]] = {}
        self._open: set[int] = set()
        self._left = MOST_VALUES

    def value(self, node: Node, location: Location) -> Any:  # noqa: ANN401 - what a document holds is not known yet
        self._left -= 1
        if self._left <= 0:
            if self._left == 0:
                self._fault(node, f"more than {MOST_VALUES:,} values, aliases written out", "write fewer aliases")
            return None
        self.value_places[location] = _place(node)
        if isinstance(node, ScalarNode):
            return self._scalar(node)
        if id(node) in self._open:
            self._fault(node, "this alias contains itself", "write the value out")
            return None
        self._open.add(id(node))
        data: Any = None
        if isinstance(node, SequenceNode):
            self._refuse_tag(node, "seq")
            data = tuple(self.value(item, (*location, index)) for index, item in enumerate(node.value))
        elif isinstance(node, MappingNode):
            self._refuse_tag(node, "map")
            data = self._mapping(node, location)
        self._open.discard(id(node))
        return data

    def _mapping(self, node: MappingNode, location: Location) -> dict[Any, Any]:
        data: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                self._fault(key_node, "a key must be one word or number", "write it as `key: value`")
                continue
            key = self._scalar(key_node)
            if type(key) not in {str, int}:  # `null`, `true` and `1.5` are words where a key stands
                key = key_node.value
            if key in data:
                line = self.key_places[*location, key][0]
                self._fault(
                    key_node,
                    f"the key `{shortened(key_node.value)}` stands here a second time, first in line {line}",
                    "remove one",
                )
                continue
            self.key_places[*location, key] = _place(key_node)
            data[key] = self.value(value_node, (*location, key))
        return data

    def _scalar(self, node: ScalarNode) -> Any:  # noqa: ANN401 - the type stands in the file
        kind, text = (node.tag or "").removeprefix(_TAG), node.value
        if kind in _PLAIN_TEXT:
            if not text.isascii() and _HALF.search(text):
                self._fault(node, "half a surrogate pair is no character", "write the whole character")
                return None
            return text
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind in {"int", "float"}:
            return self._number(node, kind, text.replace("_", "").lower())
        if kind == "merge":
            self._fault(node, "merge keys `<<` are not allowed", "write the entries out")
        else:
            self._refuse_tag(node)
        return None

    def _number(self, node: ScalarNode, kind: str, digits: str) -> float | int | None:
        try:
            if kind == "float":
                return float(digits.replace(".inf", "inf").replace(".nan", "nan"))
            whole = int(digits, 0) if digits.lstrip("+-")[:2] in {"0o", "0x", "0b"} else int(digits)
            float(whole)  # beyond what any quantity can be
        except OverflowError:
            self._fault(node, "this number is too large", "check its digits")
        except ValueError:
            self._fault(node, f"`{shortened(node.value)}` is not a number", "write digits with a dot as decimal sign")
        else:
            return whole
        return None

    def _refuse_tag(self, node: Node, but: str = "") -> None:
        if node.tag != _TAG + but:
            what = f"the tag `{shortened(str(node.tag))}` is not allowed"
            self._fault(node, what, "remove it, values need no tags here")

    def _fault(self, node: Node, what: str, remedy: str) -> None:
        self.faults.add(what, remedy, *_place(node))


def _place(node: Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1
