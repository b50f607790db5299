"""One panel of a figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dbbstation.errors import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


@dataclass(frozen=True)
class OnePanel:
    """Axes that one panel of a figure is drawn into."""

    axes: Any
    name: str | None

    def draw(self, panels: Mapping[str, Callable[[Any], object]]) -> Any:  # noqa: ANN401 - the Axes
        """Draw the panel and return its Axes.

        Raises:
            ArgumentError: no panel has that name.
        """
        fits = [name for name in panels if self.name is None or f"{name} ".startswith(f"{self.name} ")]
        if not fits:
            raise ArgumentError("panel", f"{self.name!r} is not one of {', '.join(map(repr, panels))}")
        panels[fits[0]](self.axes)
        return self.axes
