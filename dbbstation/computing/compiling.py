"""Tell listeners that numerical loops are being compiled: some seconds, once per computer."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

_told: list[Callable[[bool], None]] = []


def tell_of_compiling(tell: Callable[[bool], None]) -> None:
    """Call `tell` with True before and False after this process compiles a loop."""
    _told[:] = [tell]


def listen_to_compiler() -> None:
    """Report compilations to the listeners; code loaded from disk causes no report."""
    from numba.core import event  # noqa: PLC0415 - a third of a second, of which the compiler's user has paid already

    class CompileListener(event.Listener):
        """Counts nested compilations."""

        def __init__(self) -> None:
            self.depth = 0

        def on_start(self, _: object) -> None:
            self.depth += 1
            if self.depth == 1:
                for tell in _told:
                    tell(True)  # noqa: FBT003 - begun

        def on_end(self, _: object) -> None:
            self.depth -= 1
            if self.depth == 0:
                for tell in _told:
                    tell(False)  # noqa: FBT003 - ended

    event.register("numba:compile", CompileListener())  # type: ignore[no-untyped-call]
