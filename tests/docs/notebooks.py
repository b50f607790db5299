"""Runs a notebook without a kernel: its cells are plain Python, one after the other in one namespace.

`python -m tests.docs.notebooks docs/mismatch.ipynb` runs it and keeps what it prints and draws beside its cells. A kernel and its
client would be five packages for one page.
"""

from __future__ import annotations

import base64
import io
import json
import sys
import tempfile
from contextlib import chdir, redirect_stdout
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

DOTS_PER_INCH = 70


def executed(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    """Code cells with their outputs as they come now; an exception of a cell is that of the notebook."""
    mpl.use("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    found = []
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        printed = io.StringIO()
        with redirect_stdout(printed):
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)  # noqa: S102 - our own notebook
        found.append({**cell, "outputs": [*_text(printed.getvalue()), *_pictures()]})
    return found


def printed(cell: dict[str, Any]) -> str:
    return "".join("".join(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


def _text(text: str) -> list[dict[str, Any]]:
    return [{"name": "stdout", "output_type": "stream", "text": text.splitlines(keepends=True)}] if text else []


def _pictures() -> list[dict[str, Any]]:
    found = []
    for number in plt.get_fignums():
        drawn = io.BytesIO()
        plt.figure(number).savefig(drawn, format="png", dpi=DOTS_PER_INCH)
        data = {"image/png": base64.b64encode(drawn.getvalue()).decode("ascii")}
        found.append({"data": data, "metadata": {}, "output_type": "display_data"})
    plt.close("all")
    return found


def main(path: Path) -> None:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    # What cells write is no part of the project.
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        code = iter(executed(notebook))
    notebook["cells"] = [next(code) if cell["cell_type"] == "code" else cell for cell in notebook["cells"]]
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
