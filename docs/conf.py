"""How Sphinx builds the documentation: sphinx-build -q -W -b html docs docs/_build."""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, ClassVar

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import generate  # noqa: E402 - stands beside this file
from sphinx.domains.python import PythonDomain  # noqa: E402

from dbbstation import __version__  # noqa: E402 - after the path, which Sphinx does not set

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.domains.python import ObjectEntry

project = "dbbstation"
author = "dbbstation authors"
project_copyright = "2026, dbbstation authors"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "figures"]
nitpicky = False  # types of other packages have no page to link to
suppress_warnings = ["ref.python"]  # two packages may have a class of one name, such as Program

myst_enable_extensions = ["deflist", "colon_fence"]
myst_heading_anchors = 3

default_role = "literal"  # single backticks in docstrings are names, as in Markdown
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
autodoc_use_type_comments = False  # we write annotations; Sphinx would parse each function anew
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
smartquotes = False  # straight quotes, as in the sources and on a terminal

html_theme = "alabaster"
html_title = f"dbbstation {release}"
html_theme_options = {"page_width": "1100px", "description": project, "fixed_sidebar": True}
html_show_sourcelink = False


class PythonByLastName(PythonDomain):
    """Looks for a name only among objects that end in its last part; Sphinx tries all objects for each reference, in half of its time."""

    _by_last: ClassVar[dict[str, dict[str, ObjectEntry]]] = {}
    _looked_for: str | None = None

    @property
    def objects(self) -> dict[str, ObjectEntry]:
        """All objects, or while a name is looked for, those that may be it."""
        return super().objects if self._looked_for is None else self._by_last.get(self._looked_for, {})

    def find_obj(self, *words: object, **more: object) -> list[tuple[str, ObjectEntry]]:
        """Find what Sphinx finds; references are resolved when all pages are read, so the index is built once."""
        if not self._by_last:
            for name, entry in super().objects.items():
                self._by_last.setdefault(_last(name), {})[name] = entry
        self._looked_for = _last(str(words[3]))
        try:
            return super().find_obj(*words, **more)
        finally:
            self._looked_for = None


def _last(name: str) -> str:
    return name.removesuffix("()").rpartition(".")[2]


def setup(app: Sphinx) -> None:
    """Write the pages that come from the code before any page is read."""
    logging.getLogger("sphinx").setLevel(logging.INFO)  # its hundred thousand lines for debugging are not shown
    app.add_domain(PythonByLastName, override=True)
    app.connect("builder-inited", lambda _: generate.write_pages(HERE / "_generated"))
    app.connect("autodoc-skip-member", _of_others)
    app.connect("autodoc-process-docstring", _plain_text, priority=400)  # before napoleon takes sections apart
    app.connect("autodoc-process-docstring", _types, priority=600)  # after it


def _of_others(_app: Sphinx, what: str, _name: str, thing: object, skip: bool, _options: object) -> bool:  # noqa: FBT001 - as Sphinx calls it
    """Skip methods that another package writes into our classes, as matplotlib does."""
    foreign = what == "class" and isinstance(thing, FunctionType) and not thing.__module__.startswith("dbbstation")
    return skip or foreign


def _plain_text(_app: Sphinx, what: str, _name: str, _thing: object, _options: object, lines: list[str]) -> None:
    """Docstrings are plain text with names in backticks: what Sphinx would take for more is escaped."""
    lines[:] = generate.with_drawings(lines) if what == "module" else [generate.escaped(line) for line in lines]


def _types(_app: Sphinx, _what: str, _name: str, _thing: object, _options: object, lines: list[str]) -> None:
    """Types that end in an underscore, such as np.bool_, are no references."""
    lines[:] = [re.sub(r"_(?=\W)", r"\\_", line) if line.startswith(":vartype") else line for line in lines]
