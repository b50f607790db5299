"""The protocol files: finding, reading, checking them."""

from __future__ import annotations

import json
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from dbbstation.errors import InputError, InstrumentError, Problem
from dbbstation.files.shipped import shipped_folder
from dbbstation.instrument.protocol import Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ruamel.yaml.nodes import Node


def instruments_folder() -> Path:
    """Return the folder of the instruments that the package ships."""
    return shipped_folder("protocols") / "instruments"


def known_instruments(folder: Path | None = None) -> list[str]:
    """Return the names of the instruments in `folder` (the shipped ones by default), sorted."""
    return sorted(path.stem for path in (folder or instruments_folder()).glob("*.yaml"))


def load_instrument(name_or_file: str | Path) -> Protocol:
    """Return the protocol of a shipped instrument, or of a file (a name that ends in `.yaml`).

    Raises:
        InstrumentError: no instrument of that name.
        InputError: the file cannot be read or is wrong; every fault is listed with line and column.
    """
    path = Path(name_or_file)
    if path.suffix in {".yaml", ".yml"}:
        return read_protocol(path)
    name = str(name_or_file)
    known = known_instruments()
    if name not in known:
        near = get_close_matches(name, known, n=1)
        raise InstrumentError(
            f"no instrument is called {name!r}",
            remedy=f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}; or give a .yaml file",
        )
    return read_protocol(instruments_folder() / f"{name}.yaml")


def read_protocol(path: Path) -> Protocol:
    """Return the protocol in the file `path`.

    Raises:
        InputError: the file cannot be read or is wrong; every fault is listed with line and column.
    """
    try:
        text = path.read_text(encoding="utf-8")
        tree = YAML(typ="safe", pure=True).compose(text)
        content = YAML(typ="safe", pure=True).load(text)
    except OSError as error:
        raise InputError([Problem(str(path), 0, 0, error.strerror or str(error))]) from None
    except UnicodeDecodeError:
        raise InputError([Problem(str(path), 0, 0, "not UTF-8 text")]) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        raise InputError([Problem(str(path), line, column, error.problem or "not YAML")]) from None
    except YAMLError as error:
        raise InputError([Problem(str(path), 0, 0, str(error))]) from None
    try:
        # Through JSON, because only there does strict validation take a list for a tuple.
        protocol = Protocol.model_validate_json(json.dumps(content, default=str), strict=True)
    except ValidationError as error:
        raise InputError(_problem(path, tree, fault["loc"], fault["msg"]) for fault in error.errors()) from None
    if protocol.name != path.stem:
        remedy = f"rename the file to {protocol.name}.yaml or change the name in it"
        raise InputError([_problem(path, tree, ("name",), f"the name {protocol.name!r} is not the file's", remedy)])
    return protocol


def _problem(path: Path, tree: Node | None, location: Sequence[int | str], what: str, remedy: str = "") -> Problem:
    """Return a fault with its place: the deepest node of the file on the way to `location`."""
    node, mark = tree, tree.start_mark if tree is not None else None
    keys: list[str] = []
    for step in location:
        value = getattr(node, "value", None)
        if isinstance(value, list) and isinstance(step, int) and step < len(value) and not isinstance(value[step], tuple):
            node = value[step]
        elif isinstance(value, list) and isinstance(step, str):
            pair = next((pair for pair in value if isinstance(pair, tuple) and pair[0].value == step), None)
            if pair is None:
                # A missing key, or the tag that pydantic puts in for the kind of a part.
                keys += [] if step == getattr(node, "kind", None) else [step]
                continue
            mark, node = pair[0].start_mark, pair[1]
            keys.append(step)
            continue
        else:
            continue
        mark = node.start_mark
        keys.append(str(step))
    where = ".".join(keys)
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (0, 0)
    return Problem(str(path), line, column, f"{where}: {what}" if where else what, remedy)
