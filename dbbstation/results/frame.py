"""What every result offers: JSON, table, figure, notebook view."""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from dbbstation.errors import OutputError, StationError
from dbbstation.facts.serialise import AsItIs, Kept, json_of, plain
from dbbstation.files.atomic import write_bytes

if TYPE_CHECKING:
    from os import PathLike


class Picture(bytes):
    """A figure as SVG for notebooks."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return self.decode("utf-8")


FORMATS = (".svg", ".png", ".pdf")
"""Formats of figures, by the ending of the file."""

MOST_SHOWN = 60
"""Rows that a notebook shows of a table."""


@dataclass(frozen=True, kw_only=True)
class Framed:
    """A result that can be shown.

    Attributes:
        drawing: draws by file extension; None without figure.
        notes: printed on standard error.
    """

    drawing: Annotated[Callable[[object], bytes] | None, AsItIs, Kept] = field(default=None, repr=False, compare=False)
    notes: Annotated[tuple[str, ...], Kept] = field(default=(), repr=False)

    def rows(self) -> list[dict[str, object]]:
        """Return the main table, a dictionary per row, units in names."""
        raise NotImplementedError

    def sentences(self) -> list[str]:
        """The answer in words, which a notebook shows above the table; none where the table is the answer."""
        return []

    def to_dict(self) -> dict[str, Any]:
        """Return plain objects as the command's `--json` prints."""
        return plain(self)

    def to_json(self, indent: int | None = 1) -> str:
        """Return JSON without the command line's provenance."""
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

    def plot(self, path: str | PathLike[str] | None = None, *, force: bool = False) -> Picture | None:
        """Draw the result.

        Args:
            path: .svg, .png or .pdf; None: return the figure.
            force: overwrite the file.

        Returns:
            The figure as SVG; None where it was written to a file.

        Raises:
            OutputError: no figure, another extension, or the file exists without `force`.
        """
        if self.drawing is None:
            raise OutputError(f"a {type(self).__name__} has no figure")
        if path is None:
            return Picture(self.drawing(FORMATS[0]))
        file = Path(path)
        if file.suffix.lower() not in FORMATS:
            raise OutputError("figures are written as .svg, .png or .pdf", where=str(file), remedy="name such a file")
        write_bytes(file, self.drawing(file.suffix.lower()), force=force)
        return None

    def _repr_html_(self) -> str:
        rows = self.rows()
        names = list(dict.fromkeys(name for row in rows for name in row))
        head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        body = "".join(
            f"<tr>{''.join(f'<td>{html.escape(_shown(row.get(name)))}</td>' for name in names)}</tr>"
            for row in rows[:MOST_SHOWN]
        )
        more = f"<p>and {len(rows) - MOST_SHOWN} more rows</p>" if len(rows) > MOST_SHOWN else ""
        said = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in self.sentences())
        return f"{said}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _shown(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
