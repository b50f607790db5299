"""Parts of a frame with a device's messages and error numbers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from dbbstation.files.yaml.schema import Schema
from dbbstation.instrument.fields import Code  # noqa: TC001 (pydantic needs it at run time)

if TYPE_CHECKING:
    from dbbstation.instrument.fields import Content, FrameParts

_PRINTABLE = b"[\\x20-\\x7e]"


class Text(Schema):
    """The device's message, which is appended to the frame's meaning.

    Attributes:
        width: characters; None: 1 to `max_width`.
    """

    kind: Literal["text"]
    width: int | None = Field(default=None, ge=1, le=80)
    max_width: int = Field(default=40, ge=1, le=80)
    written: str = Field(min_length=1)

    @model_validator(mode="after")
    def _fits(self) -> Text:
        if len(self.written) > (self.width or self.max_width) or not self.written.isascii():
            raise ValueError("`written` must be ASCII and fit into the width")
        return self

    def pattern(self) -> bytes:
        return _PRINTABLE + (b"{%d}" % self.width if self.width else b"{1,%d}" % self.max_width)

    def read(self, raw: bytes, found: FrameParts) -> None:
        found.text = raw.decode("ascii").strip()

    def write(self, content: Content) -> bytes:  # noqa: ARG002 (every part has this signature)
        return self.written.ljust(self.width or 0).encode("ascii")


class ErrorTable(Schema):
    """Error numbers with meanings; unknown ones are reported as they are.

    Attributes:
        codes: the first stands for any other fault in the virtual instrument.
    """

    kind: Literal["errors"]
    codes: tuple[Code, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _codes_fit(self) -> ErrorTable:
        if len({len(code.code) for code in self.codes}) > 1 or len({code.code for code in self.codes}) < len(
            self.codes
        ):
            raise ValueError("the codes of errors are of one width, and no two are the same")
        if any(code.status == "ok" for code in self.codes):
            raise ValueError("an error has a status that is not ok")
        return self

    @property
    def width(self) -> int:
        return len(self.codes[0].code)

    def pattern(self) -> bytes:
        known = b"|".join(re.escape(code.code) for code in self.codes)
        return b"(?:" + known + b"|" + _PRINTABLE + b"{%d})" % self.width

    def read(self, raw: bytes, found: FrameParts) -> None:
        code = next((one for one in self.codes if one.code == raw), None)
        if code is None:
            found.text = f"code {raw.decode('ascii')}, which its protocol file does not list"
            return
        found.status, found.said, found.remedy = code.status, code.means, code.remedy or found.remedy

    def write(self, content: Content) -> bytes:
        return next((one.code for one in self.codes if one is content.voice), self.codes[0].code)
