"""Provenance of outputs: program, command and inputs.

It has no date: the same inputs and command give the same bytes.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation import __version__
from dbbstation.facts.record import Record, Sha256Hex
from dbbstation.facts.serialise import adapter
from dbbstation.files.atomic import refuse_existing, write_folder
from dbbstation.files.inputs import open_book

if TYPE_CHECKING:
    from pathlib import Path

BESIDE_TABLE = ".provenance.json"
"""Ending of a table's provenance file, after the table's name."""

VIRTUAL = "VIRTUAL MACHINE"
"""Mark of outputs that do not describe a real machine."""

_COMMENT = 170
"""Characters of a command in one comment; controls cut longer comments."""


@dataclass(frozen=True)
class Provenance(Record):
    """Origin of an output."""

    program: str
    """Name and version of the program that wrote it."""
    command: str
    """The command, with files without their folders."""
    inputs: Mapping[str, Sha256Hex]
    """SHA-256 of every input file, by name; the session file has the hashes of recordings."""
    virtual: tuple[str, ...] = ()
    """Inputs from a virtual machine; the model then describes no real one."""

    def data(self) -> dict[str, object]:
        """Return the provenance for JSON and YAML."""
        return adapter(Provenance).dump_python(self, mode="json", exclude_defaults=True)

    def comments(self, said: Mapping[str, str]) -> dict[str, str]:
        """Return the provenance as comments of an NC program, text by title.

        Args:
            said: comments already there; inputs hashed in them are omitted.
        """
        words = textwrap.wrap(self.command, _COMMENT, break_long_words=False, break_on_hyphens=False)
        comments = {VIRTUAL: f"computed from {', '.join(self.virtual)}"} if self.virtual else {}
        comments["written by"] = self.program
        comments |= {f"command {k}" if k > 1 else "command": text for k, text in enumerate(words, start=1)}
        known = " ".join(said.values())
        comments |= {f"input {name}": f"sha256 {digest}" for name, digest in self.inputs.items() if digest not in known}
        return comments

    def text(self) -> str:
        """Return the provenance as lines of text."""
        virtual = [f"{VIRTUAL}: {', '.join(self.virtual)}"] if self.virtual else []
        return "\n".join(
            [*virtual, self.command, *(f"{name}: sha256 {digest}" for name, digest in self.inputs.items())]
        )


def beside_table(path: Path) -> Path:
    """Return the provenance file beside a table."""
    return path.parent / (path.name + BESIDE_TABLE)  # not `with_name`: an empty name is refused where it is written


def refuse_existing_table(path: Path, *, force: bool) -> None:
    """Refuse to overwrite a table or its provenance, before long work.

    Raises:
        OutputError: one exists without `force`, or has no folder.
    """
    for each in (path, beside_table(path)):
        refuse_existing(each, force=force)


def write_table(path: Path, text: str, provenance: Provenance, *, force: bool = False) -> None:
    """Write a CSV table and its provenance, both or neither.

    Raises:
        OutputError: one exists without `force`, or cannot be written.
    """
    beside = beside_table(path)
    told = json.dumps(provenance.data(), indent=1, ensure_ascii=False) + "\n"
    write_folder(path.parent, {path.name: text, beside.name: told}, force=force)


def made_by(command: str) -> Provenance:
    """Return the provenance of a command's output, with the inputs read so far."""
    return Provenance(f"dbbstation {__version__}", command, open_book().named(), tuple(open_book().virtual))


def from_python() -> Provenance:
    """Return the provenance of a Python script's output, without command."""
    return made_by("from Python")
