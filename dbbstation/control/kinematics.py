"""A LinuxCNC kinematics component with the errors of a model, as C."""

from __future__ import annotations

import re
from dataclasses import dataclass
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError, StationError
from dbbstation.machine.geometry import STRUTS, Rotation
from dbbstation.machine.kinematics import inverse, strut_jacobian
from dbbstation.machine.statics import GRAVITY_M_S2
from dbbstation.machine.travel import middle
from dbbstation.sources.contract import Need, c_constant
from dbbstation.sources.laws.temperature import chosen
from dbbstation.sources.laws.weights import masses_for_c, strut_compliance

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from numpy.typing import ArrayLike

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.sources.contract import CForm, Fitted

LONGEST_NAME = 20
"""HAL takes 47 characters for a pin with the component's name [HAL_NAME_LEN]; the longest pin name of a source takes 26."""

PATIENCE_S = 600.0
"""A thermometer whose reading stays the same to the last bit for so long is broken or not connected [s]. Ten minutes: a reading
of 0.01 K changes each minute, one of 0.1 K changes in ten minutes unless the shop keeps its temperature to 0.1 K."""

LARGEST_K = 30.0
"""A thermometer further from its zero than this is broken: a shop is between 10 and 40 degC."""

LEAST_HELD = 0.02
"""Least Jacobian determinant, relative to the middle of the travel. At this limit gravity stretches struts fifty times
as much, and joints still move evenly. At zero the platform is loose, and a kinematics would jump."""

HELD_BY_BACKLASH = "backlash"
"""The one source with memory that a control can correct itself, by `[JOINT_n]BACKLASH`."""

_KEYWORDS = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile
    while component pin param function option license author variable description include main""".split()  # noqa: SIM905 - words
)
"""Keywords of C and of halcompile."""


@dataclass(frozen=True)
class Component:
    """A kinematics component.

    Attributes:
        mathematics: the C code that needs no LinuxCNC headers.
    """

    name: str
    text: str
    mathematics: str
    parts: tuple[str, ...]
    left_out: tuple[str, ...]
    thermometers: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Part:
    fitted: Fitted
    form: CForm
    thermometers: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.fitted.source.name.replace("-", "_")


def check_name(name: str) -> None:
    """Refuse a name that halcompile does not accept.

    Raises:
        StationError: states the possible names.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in _KEYWORDS or len(name) > LONGEST_NAME:
        raise StationError(
            f"{name!r} cannot be the name of a component in C",
            remedy=f"name the file with small letters, digits and underscores, at most {LONGEST_NAME}, such as dbbkins.comp",
        )


def component(
    model: MachineModel,
    package_text: Callable[[str], str],
    name: str,
    digest: str,
    *,
    left_out: Collection[str] = (),
    thermometers: Collection[str] = (),
) -> Component:
    """Return the component of a model.

    Args:
        package_text: returns a text file of the package by its path.
        digest: SHA-256 of the model file; its first 32 bits are a pin.
        left_out: sources that the control must not correct.
        thermometers: columns without unit that the control has.

    Raises:
        ModelError: a source not left out has memory, has no C form, or lacks an input.
        StationError: impossible name, or unknown source to leave out.
    """
    check_name(name)
    acting = [f for f in model.of_the_machine().sources if f.values.any() and not f.source.of_currents]
    names = [fitted.source.name for fitted in acting]
    if unknown := sorted(set(left_out) - set(names)):
        raise StationError(
            f"the model has no source {', '.join(unknown)} to leave out", remedy=f"its sources are {', '.join(names)}"
        )
    machine = model.as_found
    parts = [_part(fitted, machine, thermometers) for fitted in acting if fitted.source.name not in left_out]
    columns = tuple(dict.fromkeys(column for part in parts for column in part.thermometers))
    kernel, frame = (package_text(f"control/{file}") for file in ("kernel.c", "component.comp"))
    mathematics = "\n".join([_constants(machine, parts, columns), kernel, _sources(parts, columns)])
    watched = (
        f"    if (thermometer({k}, {column}_temp_c, {column}_zero_c, patience_s)) return THERMOMETER;\n"
        for k, column in enumerate(columns)
    )
    text = Template(frame).substitute(
        name=name,
        machine=re.sub(r'["\\\x00-\x1f]', " ", machine.name),
        digest=digest,
        short=digest[:12],
        first=digest[:8],
        patience=repr(PATIENCE_S),
        pins=_pins(parts, columns),
        mathematics=mathematics,
        thermometer=_THERMOMETER.replace("COUNT", str(len(columns))) if columns else "",
        switches="".join(f"        use[{k}] = use_{part.name};\n" for k, part in enumerate(parts)),
        watched="".join(watched),
    )
    out = tuple(one for one in names if one in left_out)
    return Component(name, text, mathematics, tuple(part.fitted.source.name for part in parts), out, columns)


def _part(fitted: Fitted, machine: Machine, thermometers: Collection[str]) -> _Part:
    source = fitted.source
    form = source.c_form(machine, fitted.values)
    if form is not None:
        remedy = "name the thermometers of the control with --thermometers, or leave the source out with --leave-out"
        known = chosen(source.name, form.thermometers or ((),), thermometers, "the control has no", remedy)
        return _Part(fitted, form, known)
    history = source.has_history or Need.TIME in source.needs
    why = "depends on the way so far or on time, which a kinematics does not know" if history else "has no form in C"
    entry = "; its width then goes into [JOINT_n]BACKLASH" if source.name == HELD_BY_BACKLASH else ""
    raise ModelError(
        f"the error source {source.name} {why}",
        remedy=f"leave it uncorrected with --leave-out {source.name}{entry}, or compensate programs instead",
    )


def _constants(machine: Machine, parts: Sequence[_Part], columns: Sequence[str]) -> str:
    hexapod, travel, masses = machine.hexapod, machine.travel, machine.masses
    axes = np.array([travel.x_mm, travel.y_mm, travel.z_mm, travel.a_deg, travel.b_deg, travel.c_deg])
    named: dict[str, ArrayLike] = {
        "Q": hexapod.base_joints_mm,
        "P": hexapod.platform_joints_mm,
        "REFERENCE": machine.reference_length_error_mm,
        "STRUT": travel.strut_mm,
        "LOW": axes[:, 0],
        "HIGH": axes[:, 1],
        "MIDDLE": [0.0, 0.0, float(axes[2].mean()), 0.0, 0.0, 0.0],
        "ZYX": int(hexapod.rotation is Rotation.ZYX),
        "HELD": LEAST_HELD * float(np.linalg.det(strut_jacobian(inverse(hexapod, middle(machine))))[0]),
        "BY_POSE": int(any(part.form.by_pose and not part.fitted.source.weighs for part in parts)),
        "GRAVITY": GRAVITY_M_S2,
        "WEIGHT": 0.0 if masses is None else GRAVITY_M_S2 * masses.platform_kg,
        "ABOVE": 0.0 if masses is None else masses.centre_of_gravity_above_tip_mm,
        "STRUT_KG": masses_for_c(machine.strut_masses),
        "COMPLIANCE": strut_compliance(machine).at_1000mm_mm_per_n,
        "SHARE": strut_compliance(machine).growing_share,
    }
    switches = f"static int use[{max(len(parts), 1)}] = {{{', '.join('1' for _ in parts) or '0'}}};"
    warmer = f"static double warmer[{max(len(columns), 1)}];"
    return "\n".join([*(c_constant(key, value) for key, value in named.items()), switches, warmer])


def _sources(parts: Sequence[_Part], columns: Sequence[str]) -> str:
    functions, calls = [], {True: "", False: ""}
    for number, part in enumerate(parts):
        values = {"v": part.fitted.values} if re.search(r"\bv\b", part.form.body) else {}
        constants: dict[str, ArrayLike] = {**values, **part.form.constants}
        if part.thermometers:
            constants["thermometer"] = [columns.index(column) for column in part.thermometers]
        lines = [*(c_constant(key, value) for key, value in constants.items()), *part.form.body.split("\n")]
        body = "\n".join(f"    {line}" for line in lines)
        functions.append(f"static void of_{part.name}(const seen_t *at, effect_t *e)\n{{\n{body}\n}}\n")
        calls[part.fitted.source.weighs] += f"    if (use[{number}]) of_{part.name}(at, e);\n"
    for weighs, which in ((False, "by_command"), (True, "by_weight")):
        functions.append(f"static void {which}(const seen_t *at, effect_t *e)\n{{\n{calls[weighs]}}}\n")
    return "\n".join(functions)


def _pins(parts: Sequence[_Part], columns: Sequence[str]) -> str:
    pins = [
        f'pin in bit use_{part.name} = 1 "correct {part.fitted.source.name}; taken while enabled is false";'
        for part in parts
    ]
    for column in columns:
        pins.append(f'pin in float {column}_temp_c "thermometer [degC]";')
        pins.append(f'param rw float {column}_zero_c = -999 "its reading from which growth counts [degC]";')
    return "\n".join(pins)


_THERMOMETER = f"""
static int thermometer(int k, double degc, double zero, double patience)
{{
    static double last[COUNT];
    static long long since[COUNT];
    long long now = rtapi_get_time();
    if (since[k] == 0 || degc != last[k]) last[k] = degc, since[k] = now;
    warmer[k] = degc - zero;
    return now - since[k] > patience * 1e9 || !(fabs(warmer[k]) <= {LARGEST_K!r});
}}
"""


def settings(made: Component, model: MachineModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return lines of the INI and HAL files for a component."""
    travel, name = model.machine.travel, made.name
    play = next(
        (f for f in model.sources if f.source.name == HELD_BY_BACKLASH and f.source.name in made.left_out), None
    )
    ini = ["[KINS]", f"KINEMATICS = {name}", f"JOINTS = {STRUTS}"]
    for i in range(STRUTS):
        ini += [f"[JOINT_{i}]", f"MIN_LIMIT = {travel.strut_mm[0]:.10g}", f"MAX_LIMIT = {travel.strut_mm[1]:.10g}"]
        ini += [] if play is None else [f"BACKLASH = {1e-3 * float(play.values[i]):.6f}"]
    hal = ["loadrt [KINS]KINEMATICS"]
    hal += [
        f"net {name}-enabled motion.motion-enabled => {name}.enabled  # or, if that pin has a signal: net SIGNAL => {name}.enabled"
    ]
    for column in made.thermometers:
        pin = f"{name}.{column.replace('_', '-')}"
        hal += [f"setp {pin}-zero-c DEGC  # reading at the first sample of the fitted session"]
        hal += [f"net {column}-temp THERMOMETER => {pin}-temp-c"]
    return tuple(ini), tuple(hal)
