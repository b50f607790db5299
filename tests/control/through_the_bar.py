"""Four ways on one machine, measured by its bar: `python -m tests.control.through_the_bar FOLDER [--store]`.

It does what `dbbstation demo --quick --control linuxcnc` does, twice: with the model that another session diagnoses, and with the
simulated machine as the model. The second has no error of a model. An interrupted call goes on in its folder.
"""

from __future__ import annotations

import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.demo.in_control import DIAGNOSED, run_ways
from dbbstation.demo.whole_job import QUICK

if TYPE_CHECKING:
    from dbbstation.results.demo import ControlWay

STORED = Path(__file__).parents[2] / "docs" / "validation" / "control-bar.json"
SEED = 3


def cells(way: ControlWay, faultless: ControlWay, nominal: ControlWay) -> list[str]:
    """Means of centre and G, the largest of each beyond a faultless machine [µm], and the time over that of nominal programs."""
    both = []
    for of in (lambda run: run.measured.centre_deviation_um, lambda run: run.circularity_30_upr_um.measured):
        sizes, least = [of(run) for run in way.runs], [of(run) for run in faultless.runs]
        most = max(size - other for size, other in zip(sizes, least, strict=True))
        both += [f"{sum(sizes) / len(sizes):.2f}", f"{most:+.2f}"]
    return [*both, f"{way.seconds / nominal.seconds:.4f}"]


def main() -> None:
    figures = {}
    for model, said in ((DIAGNOSED, "diagnosed model"), ("truth.yaml", "the machine as model")):
        folder = Path(sys.argv[1]) / model.removesuffix(".yaml")
        ways = run_ways(folder, SEED, print, lambda *_: None, QUICK, model=model)
        by_name = {way.way: way for way in ways}
        figures |= {
            f"{said}, {way.way}": cells(way, by_name["faultless"], by_name["nominal"])
            for way in ways
            if model == DIAGNOSED or way.way not in {"faultless", "nominal"}
        }
    kept = {
        "question": "What does a bar measure of four ways to correct one machine under LinuxCNC?",
        "data": "Tests a, h and n of [CAL Table II] in both directions on the virtual machine of seed 3, through serial line and station; "
        "0.3 µm of noise, holders put up by hand. Every way has the same balls and holders; the diagnosed session has others. "
        "`beyond` is the largest difference, of a circle, to a machine without errors.",
        "command": "python -m tests.control.through_the_bar FOLDER --store",
        "date": datetime.now(UTC).date().isoformat(),
        "seed": SEED,
        "columns": ["centre / µm", "beyond / µm", "G / µm", "beyond / µm ", "time over nominal"],
        "figures": figures,
        "limits": "Geometry and gravity are this machine's errors. A bar measures no part: control-ways.json has one, without a bar.",
    }
    text = json.dumps(kept, indent=2, ensure_ascii=False) + "\n"
    if "--store" in sys.argv:
        STORED.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
