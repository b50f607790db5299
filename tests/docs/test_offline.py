"""The documentation, built, asks nobody's computer for anything: styles, scripts, fonts and pictures lie beside its pages."""

from __future__ import annotations

import html.parser
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = """# One page of everything

![a picture](picture.svg) [a link](https://example.org) `code` and

```python
print(1)
```

| table |
| --- |
| 1 |
"""
LOADING = {
    ("script", "src"),
    ("img", "src"),
    ("link", "href"),
    ("iframe", "src"),
    ("source", "src"),
    ("object", "data"),
}
"""Attributes by which a page loads something when it is opened; a link that somebody has to follow loads nothing."""

NOT_LOADED = {"index", "search", "genindex", "next", "prev", "author", "canonical"}
"""Relations of `link` that name another page."""


IN_STYLES = re.compile(r"""(?:url\(|@import)\s*['"]?([^)'"\s]+)""")


class Resources(html.parser.HTMLParser):
    """Addresses of everything that a page loads."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag == "link" and set(given.get("rel", "").split()) & NOT_LOADED:
            return
        self.found += [value for name, value in attrs if (tag, name) in LOADING]


def missing(site):
    wrong = []
    for file in [*site.rglob("*.html"), *site.rglob("*.css")]:
        text = file.read_text("utf-8")
        addresses = Resources(text).found if file.suffix == ".html" else IN_STYLES.findall(text)
        for address in addresses:
            parts = urlsplit(address)
            if parts.scheme == "data":
                continue
            if parts.scheme or parts.netloc or not (file.parent / unquote(parts.path)).is_file():
                wrong.append((file.relative_to(site).as_posix(), address))
    return wrong


def test_a_site_built_as_ours_needs_no_network(tmp_path):
    source, site = tmp_path / "source", tmp_path / "site"
    source.mkdir()
    (source / "index.md").write_text(PAGE, "utf-8")
    (source / "picture.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>', "utf-8")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-b", "html", "-c", str(DOCS), str(source), str(site)]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    assert len(Resources((site / "index.html").read_text("utf-8")).found) >= 4
    assert missing(site) == []


@pytest.mark.skipif(not (DOCS / "_build" / "index.html").is_file(), reason="the documentation is not built")
def test_the_whole_site_needs_no_network():
    assert missing(DOCS / "_build") == []


def test_what_comes_from_elsewhere_would_be_named(tmp_path):
    (tmp_path / "page.html").write_text(
        '<script src="https://cdn.example.org/m.js"></script><img src="no.png">', "utf-8"
    )
    (tmp_path / "style.css").write_text(
        "@import 'https://fonts.example.org/f.css'; a {background: url(//x.org/p.png)}", "utf-8"
    )
    assert {address for _, address in missing(tmp_path)} == {
        "https://cdn.example.org/m.js",
        "no.png",
        "https://fonts.example.org/f.css",
        "//x.org/p.png",
    }
