"""Where an output comes from: program, command and inputs, in the form that each kind of output takes.

There is no date: the same inputs and the same command give the same bytes.
"""

from __future__ import annotations

import json
import textwrap
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.files.atomic import refuse_existing, write_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

BESIDE_TABLE = ".provenance.json"
"""What follows the name of a table in the name of the file that says where it comes from."""

_COMMENT = 170
"""Characters of a command in one comment: controls cut longer ones."""


@dataclass(frozen=True)
class Provenance:
    """Where an output comes from.

    Attributes:
        program: name and version of the program.
        command: what was asked for, without what only says where the result goes.
        inputs: SHA-256 of every file that was read, by name.
    """

    program: str
    command: str
    inputs: Mapping[str, str] = field(default_factory=dict)

    def data(self) -> dict[str, object]:
        """Return it as JSON and YAML hold it."""
        return {"program": self.program, "command": self.command, "inputs": dict(self.inputs)}

    def comments(self, said: Mapping[str, str]) -> dict[str, str]:
        """Return it as comments of an NC program, text by title.

        Args:
            said: comments that the program has already; inputs whose hash stands there are not named again.
        """
        words = textwrap.wrap(self.command, _COMMENT, break_long_words=False, break_on_hyphens=False)
        comments = {"written by": self.program}
        comments |= {f"command {k}" if k > 1 else "command": text for k, text in enumerate(words, start=1)}
        known = " ".join(said.values())
        comments |= {f"input {name}": f"sha256 {digest}" for name, digest in self.inputs.items() if digest not in known}
        return comments

    def text(self) -> str:
        """Return it as lines of text."""
        return "\n".join([self.command, *(f"{name}: sha256 {digest}" for name, digest in self.inputs.items())])


def beside_table(path: Path) -> Path:
    """Return the file beside a table that says where it comes from."""
    return path.parent / (path.name + BESIDE_TABLE)  # not `with_name`: an empty name is refused where it is written


def refuse_existing_table(path: Path, *, force: bool) -> None:
    """Refuse to overwrite a table, or the file beside it: asked before long work.

    Raises:
        OutputError: one exists and `force` is not given, or there is no folder for them.
    """
    for each in (path, beside_table(path)):
        refuse_existing(each, force=force)


def write_table(path: Path, text: str, provenance: Provenance, *, force: bool = False) -> None:
    """Write a CSV table, and beside it where it comes from; both or neither.

    A comment in the table itself would be read as its header by pandas, spreadsheets and most programs.

    Raises:
        OutputError: one exists and `force` is not given, or cannot be written.
    """
    beside = beside_table(path)
    told = json.dumps(provenance.data(), indent=1, ensure_ascii=False) + "\n"
    write_folder(path.parent, {path.name: text, beside.name: told}, force=force)
