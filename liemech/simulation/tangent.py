"""Tangent maps: the exact derivative of a discrete motion, by numbers that carry it through the
same steps.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..compiler.driver import attempt, read
from ..errors import IncompatibleSystem, InvalidInput, InvalidType
from ..formulas import Record, Vec, derivative
from ..formulas.dual import Dual
from ..formulas.pytree import build, layout_of, leaves
from ..systems.system import State, System
from .dense import evaluated, flat, told, unpacked
from .fixed_run import FixedRun
from .prepared import Steps
from .systems import Systems
from .trajectory import Trajectory

LEVEL = 0.5
"""Of the numbers that carry the derivative: below those of derivatives that formulas take."""


@dataclass(frozen=True, eq=False, repr=False)
class TangentTrajectory(Trajectory):
    """Samples of a motion, and its derivative.

    tangent : by name, "start" or that of a parameter, (n, out, in) matrices: how the state at each
    sample depends on it.  Rows are the components of the recorded parts of the state in turn; of a
    group element g the components of eta in dg = g hat(eta).  So are the columns of "start"; those
    of a parameter are its components.
    """

    tangent: dict[str, np.ndarray] = None  # type: ignore[assignment]


def tangent_run(
    plan: Steps, start: State, steps: int, t0: float, names: tuple[str, ...]
) -> TangentTrajectory:
    """So many steps from a start, with their derivative by what is named."""
    system, width = plan.one, layout_of(start).width
    frames = {
        name: frame(system, name, part) for name, part in start.parts.items() if part is not None
    }
    moves: list[np.ndarray] = []
    systems: list[Any] = []
    columns: dict[str, slice] = {}
    for name in names:
        begun = len(moves)
        if name == "start":
            at = 0
            for part, directions in frames.items():
                size = layout_of(start.parts[part]).width
                for direction in directions(np.asarray(start.parts[part])[None])[0]:
                    moves.append(
                        np.concatenate(
                            [np.zeros(at), real_numbers(direction), np.zeros(width - at - size)]
                        )
                    )
                    systems.append(None)
                at += size
        else:
            for moving in parameter_slopes(system, name):
                moves.append(np.zeros(width))
                systems.append(moving)
        columns[name] = slice(begun, len(moves))
    try:
        run = _Run(plan, start, np.array(moves), systems, steps, t0)
        made = run.trajectory()
    except (InvalidType, AttributeError) as error:
        if "series" in str(error) or "Dual" in str(error):
            raise IncompatibleSystem(
                f"Plan.tangent: {plan.method!r} computes with power series or keeps numbers that "
                "cannot carry a derivative"
            ) from None
        raise
    values, slopes = run.halves()
    states = unpacked(layout_of(start), values)
    rows = []
    at = 0
    for name, directions in frames.items():
        size = layout_of(start.parts[name]).width
        # (n, components, numbers)
        basis = real_numbers(directions(states[name])).reshape(len(values), -1, size)
        changes = slopes[:, :, at : at + size]  # (n, directions, numbers)
        rows.append(np.linalg.pinv(basis).transpose(0, 2, 1) @ changes.transpose(0, 2, 1))
        at += size
    tangent = np.concatenate(rows, axis=1)
    return TangentTrajectory(
        system, plan.method, plan.h, made.t, states, None, steps, made.compiled,
        tangent={name: tangent[:, :, part] for name, part in columns.items()},
    )  # fmt: skip


def frame(system: Any, name: str, part: Any) -> Any:
    """The directions in which a part of the state can move, as a function of the part, (n, ...) to
    (n, components, ...).
    """
    group = getattr(system, "configurations", system.group) if name == "g" else None
    size = layout_of(part).width
    if group is None:
        basis = np.eye(size).reshape(size, *np.shape(part))
        return lambda points: np.broadcast_to(basis, (len(points), *basis.shape))
    if len(np.shape(part)) != 2:  # elements that are not matrices, such as unit quaternions
        point = layout_of(part)
        arguments = group, point, layout_of(translated(group, part))

        def directions(points: np.ndarray) -> np.ndarray:
            rows = flat({name: points}, len(points))
            return evaluated(translations, arguments, rows, group.dim * size, None).reshape(
                len(points), group.dim, size
            )

        return directions
    algebra = np.array(
        [derivative(group.exp, Vec(*[0.0] * group.dim), list(unit)) for unit in np.eye(group.dim)]
    )
    return lambda points: points[:, None] @ algebra


def translated(group: Any, g: Any) -> list[Any]:
    """The directions g hat(e_i) in which an element moves."""
    still = Vec(*[0.0] * group.dim)
    units = [Vec(*[float(i == j) for j in range(group.dim)]) for i in range(group.dim)]
    return [derivative(lambda xi: group.compose_exp(g, xi), still, unit) for unit in units]


def translations(group: Any, point: Any, result: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: the directions in which an element moves."""
    told(attempt(translated, group, read(given, 0, point)), result, out, failures)


def real_numbers(array: np.ndarray) -> np.ndarray:
    """The numbers of an array in turn, a complex one as two."""
    flat = np.ascontiguousarray(array)
    return (flat.view(float) if np.iscomplexobj(flat) else flat).ravel()


def parameter_slopes(system: System, name: str) -> list[System]:
    """For every component of a parameter the system in numbers that carry its derivative by this
    component.
    """
    value = parameter(system, name)
    layout = layout_of(system)
    numbers, base = leaves(value, layout_of(value)), leaves(system, layout)
    if not numbers or "table" in repr(layout_of(value)):
        raise InvalidInput(f"Plan.tangent: {name} of {system!r} is no number, vector or matrix")
    found = []
    for i, x in enumerate(numbers):
        slopes = np.zeros(len(base))
        step = np.ldexp(1.0, int(np.frexp(abs(x) or 1.0)[1]) - 7)
        # of order 8
        for k, weight in ((1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0)):
            sides = []
            for sign in (k, -k):
                moved = [*numbers[:i], x + sign * step, *numbers[i + 1 :]]
                made = with_parameter(system, name, build(layout_of(value), iter(moved)))
                if layout_of(made) != layout:
                    raise InvalidInput(
                        f"Plan.tangent: {system!r} with another {name} is a system of another kind"
                    )
                sides.append(np.array(leaves(made, layout)))
            slopes += weight * (sides[0] - sides[1])
        found.append(
            build(
                layout,
                iter([Dual(a, float(b), LEVEL) for a, b in zip(base, slopes / step, strict=True)]),
            )
        )
    return found


def parameter(system: Any, name: str) -> Any:
    """The value of a parameter, such as "inertia" or "hamiltonian.rotor"."""
    for part in name.split("."):
        if not isinstance(system, Record) or part not in inspect.signature(type(system)).parameters:
            known = ", ".join(inspect.signature(type(system)).parameters)
            raise InvalidInput(
                f"Plan.tangent: {part} is no parameter of "
                f"{system!r}; there are {known}, and the start"
            )
        system = getattr(system, part)
    return system


def with_parameter(system: Any, name: str, value: Any) -> Any:
    """The same system made with another parameter."""
    first, _, rest = name.partition(".")
    given = {n: getattr(system, n) for n in inspect.signature(type(system)).parameters}
    given[first] = with_parameter(given[first], rest, value) if rest else value
    return type(system)(**given)


class _Run(FixedRun):
    """A run of an ensemble whose members are the directions of the derivative, all with the same
    values.
    """

    def __init__(
        self,
        plan: Steps,
        start: State,
        moves: np.ndarray,
        systems: list[Any],
        steps: int,
        t0: float,
    ) -> None:
        layout = layout_of(start)
        numbers = leaves(start, layout)
        self.duals = [
            build(
                layout, iter([Dual(x, float(d), LEVEL) for x, d in zip(numbers, move, strict=True)])
            )
            for move in moves
        ]
        if any(systems):
            still = layout_of(plan.one)
            rest = build(still, iter([Dual(x, 0.0, LEVEL) for x in leaves(plan.one, still)]))
            several = Systems(tuple(s or rest for s in systems))
            plan = replace(plan, system=several, shapes={})
        super().__init__(plan, SimpleNamespace(bodies=len(moves)), steps, t0)  # type: ignore[arg-type]

    def _member(self, i: int) -> Any:
        return self.duals[i]

    def _lay_down(self, columns: np.ndarray) -> None:
        columns[:] = self._padded(
            np.array([leaves(dual, self.shape.given) for dual in self.duals]).T
        )

    def _only_start(self) -> Trajectory:
        return Trajectory(self.plan.system, self.plan.method, self.plan.h, np.empty(0), {}, None, 0)

    def _samples(self, out: np.ndarray, steps: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return self.times(len(out), steps), {}

    def halves(self) -> tuple[np.ndarray, np.ndarray]:
        """The numbers of the states, (n, width), and their derivatives in every direction, (n,
        directions, width).
        """
        return self.out[:, 0::2, 0], self.out[:, 1::2, : self.count].transpose(0, 2, 1)
