"""Writes machines, plans, recordings and the list of runs as text that a person can read.

Small entries stand on one line, as people write them. Whether the text says what was meant is tested by reading it back
with ruamel.yaml.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.machine import TRAVEL, Machine
from tests.plant.plan import BORES, HOLDER_REPEATABILITY_UM, Path, Plan

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.run import Slot

_PLAIN = re.compile(r"([0-9]+-)?[A-Za-z][A-Za-z0-9_./()-]*|\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ|[0-9a-f]{64}")
_MISREAD = re.compile(r"true|false|null|yes|no|on|off|[0-9]+(e[0-9]+)?", re.IGNORECASE)


def flow(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{flow(key)}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(flow(item) for item in value) + "]"
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) and not _MISREAD.fullmatch(value) else json.dumps(value)
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def machine_text(machine: Machine) -> str:
    """The machine file, `dbb-machine/1`; joints to the nanometre."""

    def joints(joints_mm: FloatArray) -> str:
        return "[" + ", ".join("[" + ", ".join(f"{value:.6f}" for value in joint) + "]" for joint in joints_mm) + "]"

    return "\n".join(
        [
            "format: dbb-machine/1",
            f"name: {machine.name}",
            f"rotation: {machine.rotation}",
            f"base_joints_mm: {joints(machine.base_joints_mm)}",
            f"platform_joints_mm: {joints(machine.platform_joints_mm)}",
            f"reference_length_error_mm: {flow(machine.reference_length_error_mm)}",
            f"screw_lead_mm: {machine.screw_lead_mm}",
            f"travel: {flow(TRAVEL)}",
            "masses: "
            + flow(
                {
                    "platform_kg": machine.platform_kg,
                    "centre_of_gravity_above_tip_mm": machine.centre_of_gravity_mm[2],
                }
            ),
            "",
        ]
    )


def plan_text(plan: Plan) -> str:
    """The plan file, `dbb-plan/1`."""
    lines = [
        "format: dbb-plan/1",
        f"name: {plan.name}",
        f"path: {flow(_path_entry(plan.path))}",
        "jig:",
        f"  bores: {flow({bore: list(place_mm) for bore, place_mm in BORES.items()})}",
        f"  origin_in_machine_mm: {flow(plan.origin_in_machine_mm)}",
    ]
    if plan.rotation_about_z_deg:
        lines.append(f"  rotation_about_z_deg: {plan.rotation_about_z_deg}")
    lines.append("holders:")
    lines += [f"  {name}: {flow({'repeatability_um': size_um})}" for name, size_um in HOLDER_REPEATABILITY_UM.items()]
    lines.append("balls:")
    for ball in plan.balls:
        entry = {
            "bore": ball.bore,
            "holder": ball.holder,
            "centre_mm": ball.centre_mm,
            "uncertainty_um": ball.uncertainty_um,
        }
        lines.append(f"  {ball.name}: {flow(entry)}")
    lines.append("tests:")
    for test in plan.tests:
        test_entry: dict[str, Any] = {
            "name": test.name,
            "ball": test.ball,
            "a_deg": test.a_deg,
            "b_deg": test.b_deg,
            "elevation_deg": test.elevation_deg,
        }
        if test.path is not None:
            test_entry["path"] = _path_entry(test.path, plan.path)
        lines.append(f"  - {flow(test_entry)}")
    if plan.repeat_at_end:
        lines.append(f"repeat_at_end: {flow(plan.repeat_at_end)}")
    return "\n".join([*lines, ""])


def session_text(head: Mapping[str, object], runs: Sequence[Mapping[str, object]]) -> str:
    """The session file, `dbb-session/1`: provenance, then one line per run."""
    lines = ["format: dbb-session/1", "machine: machine.yaml", "plan: plan.yaml"]
    lines += [f"{key}: {flow(value)}" for key, value in head.items()]
    lines.append("runs:")
    lines += [f"  - {flow(run)}" for run in runs]
    return "\n".join([*lines, ""])


def recording_text(slot: Slot, columns: Mapping[str, FloatArray], *, crc: bool) -> str:
    formats = [_column_format(name) for name in columns]
    template = ",".join(formats)
    rows = np.stack(list(columns.values()), axis=1)
    flat = ((template + "\n") * len(rows)) % tuple(rows.ravel().tolist())
    if crc:
        flat = "".join(f"{line},{zlib.crc32(line.encode()):08x}\n" for line in flat.splitlines())
    head = f"# test: {slot.test.name}\n# direction: {slot.direction}\n# repeat: {slot.repeat}\n"
    return head + ",".join([*columns, "crc"] if crc else columns) + "\n" + flat


def _column_format(name: str) -> str:
    if name in {"t_s", "length_mm", "theta_deg"}:
        return "%.4f"
    return "%.2f" if name.endswith("_c") else "%.3f"


def _path_entry(path: Path, usual: Path | None = None) -> dict[str, Any]:
    return {
        key.name: getattr(path, key.name)
        for key in fields(path)
        if usual is None or getattr(path, key.name) != getattr(usual, key.name)
    }
