"""Make the sessions of docs/images/history.png, and their page, which a browser photographs.

Run from the checkout: .venv/bin/python -m docs.figures.history FOLDER, then
`chromium --headless --hide-scrollbars --window-size=1000,1310 --screenshot=docs/images/history.png FOLDER/history.html`.

120 weekly sessions of one test, made from the small recorded session; from the 81st on the centre stands 3 µm further in X, and
the 41st has a bar of 6 µm too much.
"""

from __future__ import annotations

import sys
from pathlib import Path

from dbbstation.cli import main
from tests.sessions_over_time import sessions_over_time

if __name__ == "__main__":
    place = Path(sys.argv[1])
    sessions_over_time(place / "sessions", 120, seed=5, step_at=80, step_um=3.0, long_at=40, long_um=6.0)
    (place / "sessions" / "dbbstation-settings.yaml").write_text(
        "format: dbb-settings/1\ntolerances:\n"
        "  - {quantity: circular-deviation, largest: 35, unit: µm}\n"
        "  - {quantity: centre-deviation, largest: 42, unit: µm}\n",
        encoding="utf-8",
    )
    main(["history", str(place / "sessions"), "--page", str(place / "history.html"), "--force"])
