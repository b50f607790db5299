"""NC programs that command the circles of a plan, where these are not the plain nominal ones."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RunProgram:
    """A program that commands one run.

    Attributes:
        name: of its file.
        content: its bytes.
        model_sha256: of the model file that it was compensated with; empty where none.
    """

    name: str
    content: bytes
    model_sha256: str
