"""Text of the pages of a PDF that Chromium printed, by its fonts' ToUnicode tables [ISO 32000-1, 9.10.3]."""

from __future__ import annotations

import re
import zlib


def pages_of(data: bytes) -> list[str]:
    """Return the text of every page, in the order in which it is drawn."""
    objects = {int(m[1]): m[2] for m in re.finditer(rb"(?m)^(\d+) 0 obj\s(.*?)endobj", data, re.DOTALL)}
    pages = [body for body in objects.values() if re.search(rb"/Type /Page\b(?!s)", body)]
    return [_text(objects, page) for page in pages]


def _text(objects: dict[int, bytes], page: bytes) -> str:
    fonts = {name: _letters(objects, objects[int(at)]) for name, at in re.findall(rb"/(F\d+) (\d+) 0 R", page)}
    drawn = _stream(objects[int(re.search(rb"/Contents (\d+) 0 R", page)[1])])
    letters: dict[int, str] = {}
    told = []
    for font, codes, new in re.findall(rb"/(F\d+) [\d.]+ Tf|<([0-9A-Fa-f]+)>|\b(ET)\b", drawn):
        if font:
            letters = fonts[font]
        elif new:
            told.append("\n")
        else:
            told += [letters.get(int(codes[k : k + 4], 16), "?") for k in range(0, len(codes), 4)]
    return "".join(told)


def _letters(objects: dict[int, bytes], font: bytes) -> dict[int, str]:
    table = _stream(objects[int(re.search(rb"/ToUnicode (\d+) 0 R", font)[1])])
    found: dict[int, str] = {}
    for block in re.findall(rb"beginbfchar(.*?)endbfchar", table, re.DOTALL):
        found |= {int(a, 16): _said(b) for a, b in re.findall(rb"<(\w+)> <(\w+)>", block)}
    for block in re.findall(rb"beginbfrange(.*?)endbfrange", table, re.DOTALL):
        for first, last, at in re.findall(rb"<(\w+)> <(\w+)> <(\w+)>", block):
            begin = int(first, 16)
            found |= {code: chr(int(at, 16) + code - begin) for code in range(begin, int(last, 16) + 1)}
    return found


def _said(digits: bytes) -> str:
    return bytes.fromhex(digits.decode()).decode("utf-16-be")


def _stream(body: bytes) -> bytes:
    content = body.split(b"stream", 1)[1].lstrip(b"\r\n").rsplit(b"endstream", 1)[0]
    return zlib.decompressobj().decompress(content) if b"/FlateDecode" in body else content
