"""How far a step is from a Poisson map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput, LiemechError, require
from ..formulas import Vec, jacobian, vec
from ..formulas.vectors import small
from ..groups.poisson_structure import Canonical, LiePoissonStructure, PoissonStructure
from ..integrators.method import Method
from ..rooms.constraints.constrained import ConstrainedSystem
from ..rooms.poisson.local_coordinates import InducedStructure, LocalChart
from ..rooms.poisson.poisson import POISSON_SYSTEMS, PoissonState
from ..systems.canonical import CanonicalState, HamiltonianSystem
from ..systems.in_time.driven import DrivenHamiltonianSystem, DrivenLiePoissonSystem
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.system import State, System
from .points.sample_points import STEP, size
from .points.sample_states import CENTRAL

NEAR = 2.0**-26
"""How far the coordinates of a state may lead from it, relative to its size: it is then on the
manifold of the chart.
"""


def poisson_defect(method: Method, system: System, state: State, h: float, chart: LocalChart | None = None) -> float:
    """How far a step Phi of length h is from a Poisson map: max |Phi' B(y) Phi'^T - B(Phi(y))|/max
    |B(Phi(y))|.

    system : a PoissonSystem, a LiePoissonSystem (its momenta) or a HamiltonianSystem; a
    ConstrainedSystem with a chart.  state : one state, `system.state(...)`.
    chart : a LocalChart of the manifold on which the system moves, with its `coordinates`: the step
    is looked at in them, B is that of `InducedStructure`.  It is a Poisson map there if and only if
    it is symplectic on the manifold, in whatever coordinates.
    Rounding, 1e-12 or less, for a Poisson map.  Phi' is exact to
    rounding where the step is explicit: the step is made with numbers that carry their derivative.
    Steps that are iterated have derivatives that lag behind; for them Phi' is taken by differences
    too, of order eight, and the smaller defect counts.

    Raises IncompatibleSystem for other systems, and what the method refuses; InvalidInput for
    ensembles, and for a state that is not in the chart.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.1 and VII.4.3;
    the slides, (2.20).
    """
    require("poisson_defect: method", method, Method, "a Method, such as Splitting(order=2)")
    structure, y = _point(system, state) if chart is None else _in_chart(system, state, chart)
    method.require(system)

    def end(x: Any) -> Vec:
        begin = method.start(system, _state(system, x if chart is None else chart.embedding(x)), h)
        last = method.observe(method.step(system, 0.0, begin, h))
        return vec(*[component for name in system.coordinates for component in getattr(last, name)])

    def step(x: Any) -> Vec:
        return end(x) if chart is None else chart.coordinates(end(x))

    if chart is not None and _off(chart, end(y)):
        raise InvalidInput(
            f"poisson_defect: a step of {method!r} leaves the manifold of {chart!r}; it has no coordinates there"
        )
    after = step(y)
    B, B_after = (np.array(structure.matrix(x), dtype=float) for x in (y, after))
    unit = float(np.abs(B_after).max(initial=0.0)) or 1.0
    defects = []
    for derivative in (_exact, _by_differences):
        D = derivative(step, y)
        if D is not None:
            defects.append(float(np.abs(D @ B @ D.T - B_after).max(initial=0.0)) / unit)
    if not defects or not math.isfinite(min(defects)):
        raise InvalidInput(
            f"poisson_defect: a step of {method!r} with h = {h:g} has no derivative at {list(map(float, y))}"
        )
    return min(defects)


def _exact(step: Any, y: Vec) -> np.ndarray | None:
    """The derivative by numbers that carry it along; None for a step that does not bear them."""
    try:
        D = np.array(jacobian(step, y), dtype=float)
    except (TypeError, AttributeError, LiemechError, ArithmeticError, ValueError):
        return None
    return D if np.isfinite(D).all() else None


def _by_differences(step: Any, y: Vec) -> np.ndarray | None:
    """The derivative by differences of order eight, of steps that depend on the size of the
    components.
    """
    numbers = np.array(y, dtype=float)
    whole = size(numbers) or 1.0
    columns = []
    for j, x in enumerate(numbers):
        distance = 0.25 * STEP * (abs(x) if abs(x) > 0.1 * whole else whole)
        starts = [numbers + k * distance * np.eye(len(numbers))[j] for k in range(-4, 5)]
        ends = [np.array(step(Vec.of(s.tolist())), dtype=float) for s in starts]
        columns.append(sum(w * end for w, end in zip(CENTRAL, ends, strict=True)) / distance)
    D = np.stack(columns, axis=1)
    return D if np.isfinite(D).all() else None


def _point(system: Any, state: Any) -> tuple[PoissonStructure, Vec]:
    """The structure, and the coordinates of the state."""
    if isinstance(system, POISSON_SYSTEMS):
        structure: PoissonStructure = system.structure
    elif isinstance(system, (LiePoissonSystem, DrivenLiePoissonSystem)):
        structure = LiePoissonStructure(system.group)
    elif isinstance(system, (HamiltonianSystem, DrivenHamiltonianSystem)):
        structure = Canonical(system.degrees)
    elif isinstance(system, ConstrainedSystem):
        raise IncompatibleSystem(
            f"poisson_defect: {system!r} moves on a submanifold; give coordinates of it, chart=..., "
            "a LocalChart, or use check_method, which needs none"
        )
    else:
        raise IncompatibleSystem(
            f"poisson_defect needs a PoissonSystem, LiePoissonSystem or HamiltonianSystem; got {system!r}"
        )
    return structure, _numbers(system, state)


def _in_chart(system: Any, state: Any, chart: Any) -> tuple[PoissonStructure, Vec]:
    """The induced structure, and the coordinates of the state in the chart."""
    if not isinstance(system, (ConstrainedSystem, HamiltonianSystem)):
        raise IncompatibleSystem(
            f"poisson_defect: with a chart, a ConstrainedSystem or a HamiltonianSystem is needed; got {system!r}"
        )
    require("poisson_defect: chart", chart, LocalChart)
    x = _numbers(system, state)
    if _off(chart, x):
        raise InvalidInput(
            f"poisson_defect: the state {list(map(float, x))} is not in {chart!r}: its coordinates "
            f"lead to {list(map(float, chart.embedding(chart.coordinates(x))))}"
        )
    return InducedStructure(chart), chart.coordinates(x)


def _off(chart: LocalChart, x: Vec) -> bool:
    """Whether the coordinates of a point do not lead back to it."""
    point = np.array(x, dtype=float)
    back = np.array(chart.embedding(chart.coordinates(x)), dtype=float)
    return back.shape != point.shape or not size(back - point) <= NEAR * size(point)


def _numbers(system: Any, state: Any) -> Vec:
    """The coordinates of one state."""
    if not isinstance(state, State) or state.bodies is not None:
        raise InvalidInput(f"poisson_defect: state must be one state, system.state(...); got {state!r}")
    parts = [small(np.asarray(getattr(state, name))) for name in system.coordinates]
    return vec(*[x for part in parts for x in part])


def _state(system: Any, x: Any) -> State:
    """The state with these coordinates."""
    if isinstance(system, POISSON_SYSTEMS):
        return PoissonState(vec(*x))
    if isinstance(system, (LiePoissonSystem, DrivenLiePoissonSystem)):
        return BodyState(vec(*x), None)
    n = system.degrees
    return CanonicalState(vec(*[x[i] for i in range(n)]), vec(*[x[n + i] for i in range(n)]))
