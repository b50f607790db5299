"""Ports through which terms act in a simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import SimulatorPort
    from dbbstation.diagnosis.simulator.terms import Evaluate


class SimulationFault(Exception):  # noqa: N818 - a fault of the user's simulator
    """Invalid outputs of a simulator."""


class Ports:
    """`ports.NAME(t, signals)` returns the sum of its terms, for numbers or arrays."""

    def __init__(
        self, ports: Sequence[SimulatorPort], acting: Mapping[str, Sequence[Evaluate]], *, records: bool
    ) -> None:
        self._names = tuple(port.name for port in ports)
        self._kept: dict[str, list[tuple[float, ...]]] = {port.name: [] for port in ports}
        self._signals = {port.name: tuple(port.signals) for port in ports}
        for port in ports:
            setattr(self, port.name, self._port(port.name, list(acting.get(port.name, ())), records=records))

    def __getattr__(self, name: str) -> Callable[..., float]:
        there = ", ".join(self.__dict__.get("_names", ()))
        raise SimulationFault(f"`ports.{name}` is no port of the model; there are {there or 'none'}")

    def recorded(self) -> dict[str, dict[str, Floats]]:
        """Return times and signals of all calls by port, shape (calls,)."""
        found = {}
        for name, rows in self._kept.items():
            signals = ("t", *self._signals[name])
            table = np.array(rows, dtype=np.float64).reshape(-1, len(signals))
            found[name] = {signal: table[:, k] for k, signal in enumerate(signals)}
        return found

    def _port(self, name: str, acting: Sequence[Evaluate], *, records: bool) -> Callable[..., float | Floats]:
        signals_of, kept = self._signals[name], self._kept[name]

        def at(t: float, signals: Mapping[str, float]) -> float:
            if records:
                try:
                    kept.append((t, *(signals[signal] for signal in signals_of)))
                except KeyError as error:
                    raise SimulationFault(f"`ports.{name}` is called without the signal {error}") from error
            total = 0.0
            for act in acting:
                total += act(t, signals)
            return total

        def called(t: float, signals: Mapping[str, float]) -> float | Floats:
            if isinstance(t, np.ndarray):
                columns = {s: np.broadcast_to(signals[s], t.shape).tolist() for s in signals_of}
                rows = zip(*columns.values(), strict=True) if columns else ((),) * len(t)
                pairs = zip(t.tolist(), rows, strict=True)
                return np.array([at(one, dict(zip(columns, row, strict=True))) for one, row in pairs])
            return at(t, signals)

        return called if records else _quickly(acting, called)


PortCall: TypeAlias = "Callable[[float, Mapping[str, float]], float | Floats]"
"""Function that a simulator calls with time and signals; it returns the terms' value."""


def _quickly(acting: Sequence[Evaluate], called: PortCall) -> PortCall:
    if not acting:
        return lambda _t, _signals: 0.0
    if len(acting) == 1:
        only = acting[0]
        return lambda t, signals: only(t, signals) if type(t) is float else called(t, signals)

    def summed(t: float, signals: Mapping[str, float]) -> float | Floats:
        if type(t) is not float:
            return called(t, signals)
        total = 0.0
        for act in acting:
            total += act(t, signals)
        return total

    return summed
