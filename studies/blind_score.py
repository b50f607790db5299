"""Score a blind study's verdicts by kind and effect."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.blind_reliability import Forecast, equivalents, forecasts, reliability, share_of, sure
from studies.coverage import WITHIN

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

MOST_DECLARED = 3
"""An ambiguity of more names than this is no answer."""

HELD_OUT = (0.8, 1.3)
"""Residual of left-out tests that a right model has, in units of its predicted covariance."""

SIZES = ((0.0, 2.0), (2.0, 5.0), (5.0, np.inf))
"""Classes of size, in testable limits."""

EXACT = ("clean", "outside")
"""Kinds of session in which nothing has a law to be off from."""

NAMED = frozenset({"identified", "happened"})
"""Verdicts that give a name: a bump or a bad mounting is there as surely as a law, though no other tests can confirm it."""

NO_CANDIDATE = "not-a-candidate"
"""Kind of a session whose listed effects were not all looked for: they are then as good as outside the list."""


@dataclass(frozen=True)
class Outcome:
    """One session, judged and compared.

    Attributes:
        plan: kind of measurement.
        angles: commanded angles are recorded.
        kind: `clean`, `single`, `pair`, `triple`, `faint`, `disturbed`, `outside`, `concealed` or `not-a-candidate`.
        perturbed: the hidden effect follows its law only roughly.
        truth: hidden effects, listed or not.
        sizes: in testable limits.
        error: why there is no diagnosis; may be empty.
        detected: the diagnosis reports missing physics.
        identified: names given as `identified` or `happened`.
        declared: ambiguous names with their rivals.
        named: each hidden effect is identified.
        within: each hidden effect is identified or in a declared ambiguity of at most three.
        wrong: names given, alone or ambiguously, without such an effect.
        located: residual or misfit on the right strut or variable; None if not asked.
        quiet: no hidden effect is claimed at a wrong size.
        deviations: estimate minus truth in standard deviations, of right names, by parameter.
        pulls: the same of strut lengths and base joints, if anything was named.
        held_out: residual in predicted covariance, with the findings.
        gain: held-out residual before over after.
        said: the answer in short.
        forecasts: causes with probabilities; may be empty.
    """

    session: str
    seed: int
    plan: str
    rate_hz: float
    angles: bool
    kind: str
    perturbed: bool
    truth: tuple[str, ...]
    sizes: tuple[float, ...]
    error: str
    detected: bool
    identified: tuple[str, ...]
    declared: Mapping[str, tuple[str, ...]]
    named: bool
    within: bool
    wrong: tuple[str, ...]
    located: bool | None
    quiet: bool
    deviations: Mapping[str, float]
    pulls: tuple[float, ...]
    held_out: float
    gain: float
    said: str
    forecasts: tuple[Forecast, ...]

    @property
    def given_a_name(self) -> bool:
        """Return whether anything was named."""
        return bool(self.identified or self.declared)

    @property
    def angles_from(self) -> str:
        """Return the origin of angles, and edge sampling."""
        return "recorded angles" if self.angles else f"angles from the edges, {self.rate_hz:g} Hz"

    @property
    def law(self) -> str:
        """Return how closely the hidden effect follows its law."""
        return "law followed roughly" if self.perturbed else "law followed exactly"

    @property
    def right(self) -> bool:
        """Return whether the answer is as good as possible."""
        if self.error:
            return False
        if self.kind == "clean":
            return not self.detected and not self.given_a_name
        if self.kind in {"outside", NO_CANDIDATE}:
            return not self.given_a_name and self.located is not False
        if self.kind in {"concealed", "faint"}:
            return self.quiet and not self.wrong
        return self.within and not self.wrong

    @property
    def badness(self) -> float:
        """Return a failure's badness: wrong names and loud effects first."""
        loud = max(self.sizes, default=1.0)
        if self.error:
            return 1e4
        claimed = self.wrong or (self.kind in {"clean", "outside"} and self.given_a_name)
        return 0.0 if self.right else loud + (100.0 if claimed else 0.0) + (50.0 if self.kind == "clean" else 0.0)


def score(
    answers: Mapping[str, Mapping[str, Any]],
    verdicts: Mapping[str, Mapping[str, Any]],
    candidates: Sequence[str] | None = None,
) -> list[Outcome]:
    """Compare verdicts with answers by session, skipping sessions without verdict.

    Args:
        answers: from `blind.read_answers`.
        verdicts: from `blind.judge_sessions`.
        candidates: None for all.
    """
    return [compare(answers[name], verdicts[name], candidates) for name in sorted(answers) if name in verdicts]


def compare(answer: Mapping[str, Any], verdict: Mapping[str, Any], candidates: Sequence[str] | None = None) -> Outcome:
    """Compare one session; arguments as of `score`."""
    effects = answer["effects"]
    summary = verdict.get("summary") or _NOTHING
    by_name = {source["name"]: source for source in summary["sources"]}
    identified = tuple(name for name, source in by_name.items() if source["verdict"] in NAMED)
    declared = {n: tuple(s["ambiguous_with"]) for n, s in by_name.items() if s["verdict"] == "ambiguous"}
    listed = {effect["name"] for effect in effects if effect["listed"]}
    kind = answer["kind"] if candidates is None or listed <= set(candidates) else NO_CANDIDATE
    asked = listed if kind != "concealed" else {e["name"] for e in effects if e["testable"]}
    found = [name for name in asked if name in identified]
    groups = _hanging_together(declared)
    classes = [equivalents(by_name[name]) for name in identified]
    close = [name for name in asked if _declared_closely(name, declared, [*groups, *classes])]
    # A name is no lie where what nobody can see is really there.
    wrong = [name for name, equal in zip(identified, classes, strict=True) if not listed & equal]
    wrong += [name for name in declared if not any(name in group and listed & group for group in groups)]
    unexplained = summary["unexplained"]
    before, after = summary["held_out_rms_um"]["before"], summary["held_out_rms_um"]["after"]
    return Outcome(
        session=answer["session"],
        seed=answer["seed"],
        plan=answer["circumstances"]["plan"],
        rate_hz=answer["circumstances"]["rate_hz"],
        angles=answer["circumstances"]["angles"],
        kind=kind,
        perturbed=bool(answer.get("perturbed")),
        truth=tuple(effect["name"] for effect in effects),
        sizes=tuple(float(effect["size"]) for effect in effects),
        error=verdict.get("error", ""),
        detected=bool(summary["mismatch"]),
        identified=identified,
        declared=declared,
        named=bool(asked) and len(found) == len(asked),
        within=bool(asked) and len(set(found) | set(close)) == len(asked),
        wrong=tuple(dict.fromkeys(wrong)),
        located=_located(effects, summary) if kind in {"outside", NO_CANDIDATE} else None,
        quiet=not any(_claimed(effect, by_name.get(effect["name"])) for effect in effects if not effect["testable"]),
        deviations={
            f"{effect['name']} {key}": z
            for effect in effects
            if effect["name"] in identified and kind != "concealed"
            for key, z in _deviations(effect["amplitudes"], by_name[effect["name"]]).items()
        },
        pulls=_pulls(answer, summary),
        held_out=summary["held_out_normalised"]["after"],
        gain=before / after if after else float("nan"),
        said=_said(classes, groups, unexplained, verdict),
        forecasts=forecasts(summary["sources"], listed, perturbed=bool(answer.get("perturbed"))),
    )


def numbers(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return all tables of a study."""
    kinds = {kind: [o for o in outcomes if o.kind == kind] for kind in dict.fromkeys(o.kind for o in outcomes)}
    table: dict[str, Any] = {}
    for kind, (title, target, of) in (
        ("clean", ("false alarm", "<= 2 %", lambda o: o.detected or o.given_a_name)),
        ("single", ("detected", "", lambda o: o.detected)),
        ("single", ("named", "", lambda o: o.named)),
        ("single", ("named or within a declared ambiguity", ">= 95 %", lambda o: o.within)),
        ("single", ("wrongly named", "<= 2 %", lambda o: bool(o.wrong))),
        ("pair", ("both named", "", lambda o: o.named)),
        ("pair", ("both named or within a declared ambiguity", ">= 80 %", lambda o: o.within)),
        ("pair", ("wrongly named", "<= 2 %", lambda o: bool(o.wrong))),
        ("triple", ("all named", "", lambda o: o.named)),
        ("triple", ("all named or within a declared ambiguity", ">= 80 %", lambda o: o.within)),
        ("triple", ("wrongly named", "<= 2 %", lambda o: bool(o.wrong))),
        ("faint", ("named or within a declared ambiguity", "", lambda o: o.within)),
        ("faint", ("wrongly named", "<= 2 %", lambda o: bool(o.wrong))),
        ("disturbed", ("what is listed named or within a declared ambiguity", "", lambda o: o.within)),
        ("disturbed", ("wrongly named", "<= 2 %", lambda o: bool(o.wrong))),
        ("outside", ("detected", "", lambda o: o.detected)),
        ("outside", ("given a name", "<= 5 %", lambda o: o.given_a_name)),
        ("outside", ("located", ">= 80 %", lambda o: bool(o.located))),
        ("concealed", ("nothing claimed that cannot be seen", ">= 95 %", lambda o: o.quiet and not o.wrong)),
        (NO_CANDIDATE, ("given a name", "<= 5 %", lambda o: o.given_a_name)),
        (NO_CANDIDATE, ("located", ">= 80 %", lambda o: bool(o.located))),
    ):
        if kind in kinds:
            table[f"{kind}: {title}"] = {"target": target, **_share(kinds[kind], of)}
    single = kinds.get("single", [])
    for low, high in SIZES:
        within = [o for o in single if low <= max(o.sizes) < high]
        if within:
            title = (
                f"single of {max(low, 1.0):.0f} to {high:.0f} limits" if high < np.inf else f"single above {low:.0f}"
            )
            table[f"{title}: named or within"] = {"target": "", **_share(within, lambda o: o.within)}
    said = [one for o in outcomes for one in o.forecasts]
    if (certain := sure(said))["count"]:
        table["said with a probability of 0.95 to 1: there"] = {"target": ">= 93 %", **certain}
    deviations = [z for o in outcomes for z in o.deviations.values()]
    pulls = [z for o in outcomes if o.right for z in o.pulls]
    right = [o for o in outcomes if o.kind in {"single", "pair", "triple"} and o.right and o.named]
    return {
        "sessions": len(outcomes),
        "without_a_diagnosis": [o.session for o in outcomes if o.error],
        "shares": table,
        "right_by_recording": {
            label: _share([o for o in outcomes if o.angles_from == label], lambda o: o.right)
            for label in sorted({o.angles_from for o in outcomes})
        },
        "right_by_law": {
            law: _share([o for o in outcomes if o.law == law and o.kind not in EXACT], lambda o: o.right)
            for law in sorted({o.law for o in outcomes if o.kind not in EXACT})
        },
        "reliability": reliability(said),
        "effects": _by_effect(single),
        "confusion": _confusion(outcomes),
        "parameters_in_sigma": _spread(deviations),
        "kinematics_in_sigma": _spread(pulls),
        "held_out": {
            "normalised": _percentiles([o.held_out for o in right]),
            "inside": _share(right, lambda o: HELD_OUT[0] <= o.held_out <= HELD_OUT[1]),
            "gain": _percentiles([o.gain for o in right]),
        },
        "failures": [_failure(o) for o in sorted(outcomes, key=lambda o: -o.badness) if not o.right],
    }


_NOTHING: dict[str, Any] = {
    "mismatch": False,
    "sources": [],
    "unexplained": {"rms_um": 0.0, "strut": None, "variable": None},
    "locations": [],
    "held_out_rms_um": {"before": 0.0, "after": 0.0},
    "held_out_normalised": {"before": float("nan"), "after": float("nan")},
    "noise_um": 0.0,
    "parameter_shift": [],
}


def _hanging_together(declared: Mapping[str, Sequence[str]]) -> list[frozenset[str]]:
    """Return names connected by ambiguity."""
    groups: list[frozenset[str]] = []
    for name, others in declared.items():
        joined = frozenset({name, *others})
        touching = [group for group in groups if group & joined]
        groups = [group for group in groups if not group & joined] + [joined.union(*touching)]
    return groups


def _declared_closely(name: str, declared: Mapping[str, Sequence[str]], groups: Sequence[frozenset[str]]) -> bool:
    own = name in declared and len(declared[name]) < MOST_DECLARED
    return own or any(name in group and len(group) <= MOST_DECLARED for group in groups)


def _located(effects: Sequence[Mapping[str, Any]], summary: Mapping[str, Any]) -> bool:
    """Return whether residual or misfit is on the right strut or variable."""
    places = [summary["unexplained"], *summary["locations"][:1]]
    place = next((p for p in places if p["strut"] or p["variable"]), None)
    if place is None:
        return False
    variable = place["variable"] or ""
    return any(
        place["strut"] in effect["struts"] or any(wanted in variable for wanted in effect["variables"])
        for effect in effects
    )


def _claimed(effect: Mapping[str, Any], source: Mapping[str, Any] | None) -> bool:
    """Return whether an invisible effect is excluded or measured at another size."""
    if source is None or source["verdict"] in {"not-testable", "ambiguous"}:
        return False
    deviations = _deviations(effect["amplitudes"], source)
    return any(abs(z) > 4.0 for z in deviations.values())  # noqa: PLR2004 - four standard deviations


def _deviations(amplitudes: Mapping[str, float], source: Mapping[str, Any]) -> dict[str, float]:
    found = source["parameters"]
    return {
        key: (found[key]["value"] - value) / found[key]["uncertainty"]
        for key, value in amplitudes.items()
        if key in found and found[key]["uncertainty"] > 0
    }


def _pulls(answer: Mapping[str, Any], summary: Mapping[str, Any]) -> tuple[float, ...]:
    """Return strut lengths and base joints in standard deviations, without common height for level bars."""
    truth = answer["truth"]
    base_um = 1e3 * np.array(truth["delta_base_mm"])
    if not answer["raised_bars"]:
        base_um[:, 2] -= base_um[:, 2].mean()
    true_um = {f"strut-reference-length strut_{k + 1}": 1e3 * v for k, v in enumerate(truth["delta_length_mm"])}
    true_um |= {
        f"base-joints joint_{k + 1}_{axis}": float(row[j])
        for k, row in enumerate(base_um)
        for j, axis in enumerate("xyz")
    }
    return tuple(
        (shift["after_um"] - true_um[shift["parameter"]]) / shift["uncertainty_um"]
        for shift in summary["parameter_shift"]
        if shift["parameter"] in true_um and shift["uncertainty_um"] > 0
    )


def _said(
    classes: Sequence[frozenset[str]],
    groups: Sequence[frozenset[str]],
    unexplained: Mapping[str, Any],
    verdict: Mapping[str, Any],
) -> str:
    if "error" in verdict:
        return str(verdict["error"])
    parts = [" = ".join(sorted(equal)) for equal in dict.fromkeys(classes)]
    parts += [f"({' or '.join(sorted(group))})" for group in groups]
    if unexplained["rms_um"] > 0:
        strut = f" strut {unexplained['strut']}" if unexplained["strut"] else ""
        parts.append(f"[left {unexplained['rms_um']:.2g} µm by {unexplained['variable']}{strut}]")
    return ", ".join(parts) or "nothing"


def _share(outcomes: Sequence[Outcome], of: Callable[[Outcome], bool]) -> dict[str, Any]:
    return share_of(of(outcome) for outcome in outcomes)


def _by_effect(single: Sequence[Outcome]) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for name in sorted({o.truth[0] for o in single}):
        of_it = [o for o in single if o.truth[0] == name]
        rows[name] = {
            "count": len(of_it),
            "detected": sum(o.detected for o in of_it),
            "named": sum(o.named for o in of_it),
            "within": sum(o.within for o in of_it),
            "wrong": sum(bool(o.wrong) for o in of_it),
            "parameters_in_sigma": _spread([z for o in of_it for z in o.deviations.values()]),
        }
    return rows


def _confusion(outcomes: Sequence[Outcome]) -> dict[str, dict[str, int]]:
    """Return how often hidden effects got which names; `nothing` for none."""
    table: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        row = table.setdefault(" + ".join(sorted(outcome.truth)) or "clean", Counter())
        row.update([*outcome.identified, *(f"({name})" for name in outcome.declared)] or ["nothing"])
    return {truth: dict(row.most_common()) for truth, row in sorted(table.items())}


def _spread(values: Sequence[float]) -> dict[str, Any] | None:
    if not values:
        return None
    z = np.array(values)
    inside = float((np.abs(z) < WITHIN).mean())
    return {"count": len(z), "rms": float(np.sqrt(np.mean(z**2))), "inside_95": inside, "worst": float(np.abs(z).max())}


def _percentiles(values: Sequence[float]) -> list[float] | None:
    return np.percentile(values, [5.0, 50.0, 95.0]).tolist() if values else None


def _failure(outcome: Outcome) -> dict[str, Any]:
    return {
        "session": outcome.session,
        "seed": outcome.seed,
        "recorded": f"{outcome.plan}, {outcome.angles_from}",
        "kind": outcome.kind,
        "truth": [f"{name} {size:.1f}" for name, size in zip(outcome.truth, outcome.sizes, strict=True)],
        "said": outcome.said,
    }
