"""Asks for the shop's temperature, or goes on without."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.widgets import Static

from dbbstation.service.shop_temperature import shop_degc
from dbbstation.tui import texts
from dbbstation.tui.asking import TypeQuestion

if TYPE_CHECKING:
    from textual.widgets import Input


class TemperatureQuestion(TypeQuestion):
    """Returns a valid temperature as text, empty to go on without, or None to go back."""

    def __init__(self) -> None:
        super().__init__(texts.TEMPERATURE_NOW)

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        submitted.prevent_default()
        text = submitted.value.strip()
        if not text or shop_degc(text) is not None:
            self.dismiss(text)
        else:
            self.query_one(Static).update(f"{texts.NO_NUMBER.format(text=text)} {texts.TEMPERATURE_NOW}")
