"""Services of the app for screens before and after a sequence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.service.choice import Choice, Prepared

_Outcome = TypeVar("_Outcome")


class StationDesk(Protocol):
    """Works in the background, opens jobs, shows results; `StationApp` is one."""

    def do(
        self,
        work: Callable[[], _Outcome],
        then: Callable[[_Outcome], None],
        failed: Callable[[Exception], None],
    ) -> None:
        """Do work of some seconds; `then` takes its outcome, `failed` a StationError."""

    def open(self, choice: Choice, prepared: Prepared, failed: Callable[[Exception], None]) -> None:
        """Open a job and show its screen."""

    def show_results(self, folder: Path) -> None:
        """Show what can be done with a measured session."""
