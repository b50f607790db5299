"""How Sphinx builds the documentation: sphinx-build -q -W -b html docs docs/_build."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import generate  # noqa: E402 - stands beside this file

from dbbstation import __version__  # noqa: E402 - after the path, which Sphinx does not set

if TYPE_CHECKING:
    from sphinx.application import Sphinx

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
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "alabaster"
html_title = f"dbbstation {release}"
html_theme_options = {"page_width": "1100px", "description": project, "fixed_sidebar": True}
html_show_sourcelink = False


def setup(app: Sphinx) -> None:
    """Write the pages that come from the code before any page is read."""
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
