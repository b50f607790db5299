"""Make the table in `fixtures/tables` anew: `python -m tests.diagnosis.table.make_example`."""

from __future__ import annotations

from pathlib import Path

from tests.diagnosis.table.plant import Truth, record

TRUTH = Truth(play_um=8.0, screw_um_m_k=12.0)
SECONDS, SEED = 60.0, 7


def example() -> str:
    head = [
        "# A simulated axis of 200 mm, to and fro at 20 Hz while its oil warms up. Beside the simulation it has 8 um of play,",
        "# and its screw, held at -100 mm, grows by 12 um per metre and kelvin beyond 22 degC.",
    ]
    return "\n".join(head) + "\n" + record(TRUTH, SEED, seconds=SECONDS).csv()


if __name__ == "__main__":
    path = Path(__file__).parents[3] / "fixtures" / "tables" / "axis.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_text(example(), encoding="utf-8")
