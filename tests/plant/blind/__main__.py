"""`python -m tests.plant.blind`: sessions with hidden effects, and the sealed answers."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.plant.blind.sessions import make_study


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.plant.blind", description=__doc__)
    parser.add_argument("out", type=Path, help="folder for the sessions and answers.json; must not exist or be empty")
    parser.add_argument("--clean", type=int, default=20, help="sessions with nothing hidden")
    parser.add_argument("--single", type=int, default=25, help="one effect of the list, testable")
    parser.add_argument("--pairs", type=int, default=10, help="two of the list, separable")
    parser.add_argument("--outside", type=int, default=12, help="one effect outside the list, separable from it")
    parser.add_argument("--concealed", type=int, default=7, help="one of the list that nobody can see")
    parser.add_argument("--triples", type=int, default=0, help="three of the list, each separable from the other two")
    parser.add_argument("--faint", type=int, default=0, help="one of the list at 3 to 7 sigma, half beside a loud one")
    parser.add_argument(
        "--disturbed", type=int, default=0, help="one of the list beside a bump, a kink, a bent scale ..."
    )
    parser.add_argument("--perturbed", type=float, default=0.0, help="share of sessions off the laws of their effects")
    parser.add_argument("--seed", type=int, default=1, help="of everything")
    parser.add_argument("--jobs", type=int, help="processes; all cores if left out")
    given = parser.parse_args()
    if given.out.exists() and any(given.out.iterdir()):
        sys.exit(f"{given.out} is not empty: give a new folder")
    if not 0.0 <= given.perturbed <= 1.0:
        sys.exit(f"--perturbed {given.perturbed:g}: a share lies between 0 and 1")
    counts = {
        "clean": given.clean,
        "single": given.single,
        "pair": given.pairs,
        "outside": given.outside,
        "concealed": given.concealed,
        "triple": given.triples,
        "faint": given.faint,
        "disturbed": given.disturbed,
    }
    total = sum(counts.values())

    def told(done: int) -> None:
        sys.stderr.write(f"\r{done} of {total} sessions")
        sys.stderr.flush()

    sealed = make_study(given.out, counts, given.seed, given.jobs, told, perturbed_share=given.perturbed)
    sys.stderr.write(f"\nanswers in {sealed}\n")


if __name__ == "__main__":
    main()
