"""Common methods of all results: JSON, table, figure, notebook view; and items by name."""

from __future__ import annotations

import difflib
import html
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, SupportsIndex, TypeVar, get_args, overload

from pydantic_core import core_schema

from dbbstation.errors import ArgumentError, OutputError, StationError
from dbbstation.facts import picked
from dbbstation.facts.serialise import AsItIs, Kept, json_of, plain
from dbbstation.files.atomic import write_bytes
from dbbstation.files.provenance import Provenance, from_python, write_table
from dbbstation.text.written import words

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from os import PathLike


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


FORMATS = (".svg", ".png", ".pdf")
"""Formats of figures, by the ending of the file."""

MOST_SHOWN = 60
"""Rows that a notebook shows of a table."""


@dataclass(frozen=True, kw_only=True)
class Framed:
    """A result that can be shown.

    Attributes:
        drawing: draws a file by its extension, a panel, or (given None) a figure; None: no figure.
    """

    drawing: Annotated[Callable[[object], Any] | None, AsItIs, Kept] = field(default=None, repr=False, compare=False)
    notes: Annotated[tuple[str, ...], Kept] = field(default=(), repr=False)

    _table_of: ClassVar[tuple[str, str]]
    """Field whose items are the rows of the main table, and their fields that are its columns."""

    def rows(self) -> list[dict[str, object]]:
        """Return the main table, one dictionary per row, with units in the names."""
        items, columns = self._table_of
        return [picked(one, *words(columns)) for one in getattr(self, items)]

    def sentences(self) -> list[str]:
        """Return the sentences above a notebook's table; empty if the table is the answer."""
        return []

    def to_dict(self) -> dict[str, Any]:
        """Return the plain objects that the command's `--json` prints."""
        return plain(self)

    def to_json(self, indent: int | None = 1) -> str:
        """Return the result as JSON, without the command line's provenance."""
        return json_of(self, indent)

    def to_frame(self) -> Any:  # noqa: ANN401 - pandas is no dependency
        """Return `rows` as a pandas DataFrame.

        Raises:
            StationError: pandas is not installed.
        """
        try:
            import pandas as pd  # type: ignore[import-untyped, import-not-found, unused-ignore]  # noqa: PLC0415 - who has it
        except ImportError as error:
            raise StationError("pandas is not installed", remedy="install it, or use rows()") from error
        return pd.DataFrame(self.rows())

    def plot(self, ax: Any = None, *, panel: str | None = None) -> Any:  # noqa: ANN401 - of Matplotlib, loaded when something is drawn
        """Draw the result.

        Args:
            ax: Axes for one panel; None: a figure of all panels.
            panel: name, or its begin; None: the first.

        Raises:
            OutputError: the result has no figure.
            ArgumentError: the figure has no such panel.
        """
        if ax is None and panel is None:
            return self._drawing(None)
        from matplotlib.figure import Figure  # noqa: PLC0415 - half a second for who draws nothing

        return self._drawing(OnePanel(Figure(layout="constrained").subplots() if ax is None else ax, panel))

    def save_figure(self, path: str | PathLike[str], *, force: bool = False) -> None:
        """Write the figure as .svg, .png or .pdf.

        Raises:
            OutputError: no figure, another extension, or the file exists without `force`.
        """
        file = Path(path)
        if file.suffix.lower() not in FORMATS:
            raise OutputError("figures are written as .svg, .png or .pdf", where=str(file), remedy="name such a file")
        write_bytes(file, self._drawing(file.suffix.lower()), force=force)

    def save(
        self, path: str | PathLike[str], *, force: bool = False, provenance: Callable[[], Provenance] = from_python
    ) -> None:
        """Write the main product, by default the table of `rows` as CSV.

        Raises:
            OutputError: the file exists without `force`.
        """
        self._save(Path(path), provenance(), force=force)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        from dbbstation.files.csv_rows import table_csv  # noqa: PLC0415 - few results are saved as tables

        rows = self.rows()
        names = _columns(rows)
        columns = [["" if row.get(name) is None else row[name] for row in rows] for name in names]
        write_table(path, table_csv(names, columns), provenance, force=force)

    def _drawing(self, wanted: object) -> Any:  # noqa: ANN401 - as asked for
        if self.drawing is None:
            raise OutputError(f"a {type(self).__name__} has no figure")
        return self.drawing(wanted)

    def headline(self) -> str:
        """Return the answer in one line."""
        return next(iter(self.sentences()), f"{len(self.rows())} rows")

    def summary(self) -> str:
        """Return the sentences of the answer and its table as text."""
        rows = self.rows()
        names = _columns(rows)
        cells = [names, *([_shown(row.get(name)) for name in names] for row in rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in cells]
        return "\n".join([*(self.sentences() or [self.headline()]), "", *lines])

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline()}>"

    def __init_subclass__(cls, **more: Any) -> None:  # noqa: ANN401 - as Python has it
        super().__init_subclass__(**more)
        cls.__repr__ = Framed.__repr__  # type: ignore[method-assign] # dataclasses keep one that is there

    def _repr_html_(self) -> str:
        rows = self.rows()
        names = _columns(rows)
        head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        body = "".join(
            f"<tr>{''.join(f'<td>{html.escape(_shown(row.get(name)))}</td>' for name in names)}</tr>"
            for row in rows[:MOST_SHOWN]
        )
        more = f"<p>and {len(rows) - MOST_SHOWN} more rows</p>" if len(rows) > MOST_SHOWN else ""
        said = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in self.sentences() or [self.headline()])
        return f"{said}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _columns(rows: Iterable[Mapping[str, object]]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row))


def _shown(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


_Item = TypeVar("_Item")


class ByName(tuple[_Item, ...]):
    """Items that have a `name`, in order: `items[0]`, or `items["gravity"]`."""

    __slots__ = ()

    @overload
    def __getitem__(self, key: SupportsIndex | str, /) -> _Item: ...
    @overload
    def __getitem__(self, key: slice, /) -> tuple[_Item, ...]: ...
    def __getitem__(self, key: SupportsIndex | str | slice, /) -> _Item | tuple[_Item, ...]:
        """Return an item; for an unknown name, raise KeyError with the nearest name."""
        if not isinstance(key, str):
            return super().__getitem__(key)
        names: list[str] = [one.name for one in self]  # type: ignore[attr-defined]
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            raise KeyError(f"{key!r} is not there; did you mean {near[0]!r}?" if near else f"{key!r}: not in {names}")
        return super().__getitem__(names.index(key))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:  # noqa: ANN401 - as pydantic has it
        """Let pydantic treat it as a tuple."""
        kind: Any = tuple.__class_getitem__((get_args(source)[0], ...))
        return core_schema.no_info_after_validator_function(cls, handler.generate_schema(kind))
