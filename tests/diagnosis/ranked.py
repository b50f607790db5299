"""Ranked causes against truth on sessions of the independent virtual machine: `python -m tests.diagnosis.ranked --sessions 20`.

The truth of a cause is what the virtual machine reads with all of its mechanisms less what it reads without this one, without noise and
without errors of balls and bar.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from dbbstation.calibration.reporting.prediction import smooth_circularities_um
from dbbstation.diagnosis.diagnose import thinned
from dbbstation.tasks.diagnose import diagnose
from dbbstation.tasks.load import load
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ReversalSpike, ServoLag
from tests.plant.noise import Noise
from tests.plant.plan import elevated, table_ii_plan
from tests.plant.session import record

GEOMETRY = "geometry"

LEAD_ZERO_MM = 840.0
"""Middle of the struts' travel, 300 to 1380 mm in the machine file, where the error of a lead is nothing by definition of `screw-lead`.

What a strut is off there belongs to its reference length: about another zero, the truth would share the same error otherwise between lead
and geometry.
"""


def _gravity(rng):
    return Gravity(compliance_mm_n=float(rng.uniform(0.5e-6, 10e-6)))


def _backlash(rng):
    return Backlash(gap_um=tuple(rng.uniform(1.0, 10.0, 6).tolist()))


def _lag(rng):
    return ServoLag(time_constant_ms=tuple(rng.uniform(0.5, 6.0, 6).tolist()))


def _lead(rng):
    return ScrewLead(error_um_m=tuple(rng.normal(0.0, 30.0, 6).tolist()), zero_mm=LEAD_ZERO_MM)


def _cyclic(rng):
    return ScrewCyclic(
        amplitude_um=tuple(rng.uniform(0.5, 4.0, 6).tolist()), phase_deg=tuple(rng.uniform(0.0, 360.0, 6).tolist())
    )


def _spike(rng):
    return ReversalSpike(height_um=tuple(rng.uniform(2.0, 8.0, 6).tolist()))


MAKERS = (_gravity, _backlash, _lag, _lead, _cyclic, _spike)


CANDIDATES = ("gravity", "backlash", "servo-lag", "screw-lead", "screw-cyclic", "reversal-spike")
"""Causes that compete; `--every-source` takes all, which takes ten times as long."""


@dataclass(frozen=True)
class Scored:
    """One session.

    Attributes:
        truth: mean G of each cause [µm].
        found: mean G and its u of each cause that the diagnosis has in its model [µm].
        session: its number.
    """

    session: int
    truth: dict[str, float]
    found: dict[str, tuple[float, float]]

    @property
    def deviations(self):
        """Found less true over u, by cause that was found and is there."""
        return {k: (v - self.truth[k]) / u for k, (v, u) in self.found.items() if k in self.truth}

    @property
    def orders(self):
        """Whether each pair that differs by more than its u is in the right order."""
        both = [k for k in self.found if k in self.truth]
        return [
            (self.truth[a] - self.truth[b]) * (self.found[a][0] - self.found[b][0]) > 0.0
            for a, b in combinations(both, 2)
            if abs(self.found[a][0] - self.found[b][0]) > np.hypot(self.found[a][1], self.found[b][1])
        ]


def lengths_of(folder, seed, plan, mechanisms):
    record(
        folder,
        seed=seed,
        plan=plan,
        mechanisms=mechanisms,
        setup=[],
        noise=Noise(white_um=0.0),
        rate_hz=10.0,
        angles=True,
    )
    runs = load(folder).observations
    return {(o.test, str(o.raw.circle.direction), o.repeat): thinned(o) for o in runs}


def truth_of(folder, seed, plan, mechanisms):
    """Mean G that each mechanism makes by itself, up to 30 undulations per revolution [µm]."""
    whole = lengths_of(folder / "all", seed, plan, mechanisms)
    found = {}
    for k, mechanism in enumerate(mechanisms):
        rest = lengths_of(folder / f"without-{k}", seed, plan, [*mechanisms[:k], *mechanisms[k + 1 :]])
        g = [
            smooth_circularities_um(one.raw, [one.raw.circle.bar_mm + one.raw.length_mm - rest[key].raw.length_mm])[0]
            for key, one in whole.items()
        ]
        found[GEOMETRY if mechanism.name == "kinematics" else mechanism.name] = float(np.mean(g))
    return found


def scored(session, seed, folder, candidates=None):
    """Draw a machine with two or three causes beside its geometry, record it, diagnose it, and compare."""
    rng = np.random.default_rng([seed, session])
    chosen = rng.choice(len(MAKERS), size=int(rng.integers(2, 4)), replace=False)
    errors = Kinematics(length_mm=rng.normal(0.0, 0.03, 6), base_mm=rng.normal(0.0, 0.03, (6, 3)))
    mechanisms = [errors, *(MAKERS[k](rng) for k in sorted(chosen))]
    plan = elevated(table_ii_plan(session), 5.0, "abcde")
    truth = truth_of(folder, session, plan, mechanisms)
    record(folder / "measured", seed=session, plan=plan, mechanisms=mechanisms, noise=Noise(white_um=0.3), rate_hz=10.0)
    result = diagnose([folder / "measured"], sources=candidates)
    found = {one.cause: (one.g_um, one.g_u_um or float("nan")) for one in result.effects}
    return Scored(session, truth, found)


def missed(every):
    """Causes that are there and in no model, with what they make by themselves [µm]."""
    return [(one.session, name, one.truth[name]) for one in every for name in one.truth if name not in one.found]


def invented(every):
    """Causes that a model has and the machine has not, with what the model says of them [µm]."""
    return [(one.session, name, *one.found[name]) for one in every for name in one.found if name not in one.truth]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first session")
    parser.add_argument("--seed", type=int, default=35)
    parser.add_argument("--every-source", action="store_true", help="all causes compete, not only those that are drawn")
    arguments = parser.parse_args()
    began, every = time.process_time(), []
    for session in range(arguments.first, arguments.first + arguments.sessions):
        with tempfile.TemporaryDirectory() as folder:
            one = scored(session, arguments.seed, Path(folder), None if arguments.every_source else CANDIDATES)
        every.append(one)
        for name in dict.fromkeys([*one.truth, *one.found]):
            true, (g, u) = one.truth.get(name, 0.0), one.found.get(name, (np.nan, np.nan))
            print(
                f"{session:3d}  {name:16s} true {true:7.2f}  found {g:7.2f}  u {u:5.2f}  {(g - true) / u:+5.1f}",
                flush=True,
            )
    deviations = np.array([value for one in every for value in one.deviations.values()])
    orders = [right for one in every for right in one.orders]
    print(f"{len(every)} sessions, seed {arguments.seed}, {time.process_time() - began:.0f} s of processor time")
    print(f"pairs that differ by more than their u: {len(orders)}, in the right order {sum(orders)}")
    print(
        f"contributions: {len(deviations)}, within 2 u {np.mean(np.abs(deviations) < 2.0):.0%}, "
        f"farthest {np.abs(deviations).max():.1f} u, root mean square {np.sqrt(np.mean(deviations**2)):.2f} u"
    )
    print("missed:", *missed(every), "none" if not missed(every) else "")
    print("not there:", *invented(every), "none" if not invented(every) else "")


if __name__ == "__main__":
    main()
