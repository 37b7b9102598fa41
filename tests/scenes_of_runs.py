"""What runs are tested with: bodies, methods and observers, of numbers that need no library, and few kernels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from terms_of_spins import Exchange

import liemech as lm
from liemech.formulas import dot, vec
from liemech.simulation.compiled.execution import Execution

TURN = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0


def spread(bodies: int, size: int, salt: int = 0) -> np.ndarray:
    """Numbers between -1 and 1 that nobody has computed by a library, (bodies, size)."""
    i, k = np.arange(bodies)[:, None], np.arange(size)
    return ((37 * i + 61 * k * k + 17 * k + 7 * i * k + 29 + 13 * salt) % 101) / 50.5 - 1.0


@dataclass(frozen=True)
class Scene:
    """A system, a method, and the runs that are made of it.

    states : of the number of bodies the parts of the start, with that many rows.
    options : of the plan.  first, rest : steps, or times, until the middle and from there on.
    names, functions, events, ends : what observers look at.  libm : do its steps call the C library?
    by : what tangents are by.  alone : the body that runs when there is one.
    """

    name: str
    system: Any
    method: Any
    states: Callable[[int], dict[str, np.ndarray]]
    options: dict[str, Any] = field(default_factory=dict)
    first: Any = 11
    rest: Any = 13
    t0: float = 0.0
    until: float | None = None  # the time at the end, for t_eval
    names: tuple[str, ...] = ("mu",)
    functions: tuple[Any, ...] = ("energy",)
    events: tuple[Any, ...] = ()
    ends: tuple[Any, ...] = ()
    by: tuple[str, ...] = ("start",)
    libm: bool = False
    alone: int = 0

    def start(self, bodies: int) -> lm.State:
        """One state, or an ensemble."""
        states = self.states(max(bodies, self.alone + 1))
        if bodies == 1:
            states = {name: x[self.alone] for name, x in states.items()}
        return self.inner.state(**states)

    @property
    def inner(self) -> Any:
        """The system whose states runs begin from."""
        return self.system.system if self.system.fictive else self.system

    @property
    def by_time(self) -> bool:
        """Are runs ended by a time?"""
        return isinstance(self.first, float)

    @property
    def end(self) -> float:
        """The time at the end."""
        if self.until is not None:
            return self.until
        return self.rest if self.by_time else self.t0 + (self.first + self.rest) * self.options["h"]

    @property
    def middle(self) -> float:
        """The time in the middle."""
        return self.first if self.by_time else self.t0 + self.first * self.options.get("h", 0.0)

    @property
    def backwards(self) -> bool:
        """Does time run backwards?"""
        return self.end < self.t0

    @property
    def times(self) -> list[float]:
        """Times between start and end, both included."""
        return [self.t0 + (self.end - self.t0) * x for x in (0.0, 0.125, 0.25, 0.53125, 0.75, 0.96875, 1.0)]

    @property
    def short(self) -> dict[str, Any]:
        """A run for tangents."""
        if self.by_time and not self.inner_fictive:
            return {"t_end": self.first, "t0": self.t0}
        return {"steps": 7, "t0": self.t0}

    @property
    def inner_fictive(self) -> bool:
        """Are the steps equal in a fictive time?"""
        return bool(self.system.fictive or self.method.fictive)

    def spans(self, span: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any], list[float]]:
        """What the whole run asks for, its first half, its second, and times for samples."""
        if self.by_time:
            ends = span.get("t_end")
            half, whole = self.first, self.rest
            if ends is not None:
                half, whole = np.multiply(0.5, ends).tolist(), ends
            return ({"t_end": self.rest, "t0": self.t0}, {"t_end": half, "t0": self.t0}, {"t_end": whole}, self.times)
        t0 = {"t0": self.t0}
        if "t_end" in span:
            return t0, t0 | {"t_end": 0.5 * span["t_end"]}, {"t_end": span["t_end"]}, self.times
        steps = {"steps": self.first + self.rest} | t0
        return steps, {"steps": self.first} | t0, {"steps": self.rest}, self.times


# ---------------------------------------------------------------- observers


def first_axis(t, state):
    return state.mu[0] - 0.1


def second_axis(t, state):
    return state.mu[1] + 0.02 * t


def falling(t, state):
    return state.mu[2] - 0.4 * state.mu[1]


falling.direction = -1


def third_time(t, state):
    return state.mu[1]


third_time.terminal = 2


def below(t, state):
    return state.q[1] - 0.05


def beside(t, state):
    return state.q[0] + 0.1


def second_time(t, state):
    return state.q[1]


second_time.terminal = 2


def tilt(t, state):
    return state.g[2, 2] * state.mu[0] + 0.25 * t


def far(t, state):
    return dot(state.q, state.q) - t


OBSERVERS = (
    "all",
    "every",
    "t_eval",
    "names",
    "functions",
    "dense",
    "events",
    "ends",
    "events+t_eval",
    "ends+functions",
)


def observer(scene: Scene, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Its options of a plan, and of a run."""
    plan: dict[str, Any] = {}
    run: dict[str, Any] = {}
    for part in name.split("+"):
        if part == "every":
            plan["every"] = 5
        elif part == "t_eval":
            run["t_eval"] = scene.times
        elif part in ("names", "functions"):
            plan["record"] = getattr(scene, part)
        elif part == "dense":
            plan["dense"] = True
        elif part == "events":
            plan["events"] = scene.events
        elif part == "ends":
            plan["events"] = scene.ends
    return plan, run


# ---------------------------------------------------------------- bodies


def bodies_of(count: int) -> dict[str, np.ndarray]:
    """Momenta and attitudes."""
    mu = np.array([0.5, 0.125, 0.875]) + 0.5 * spread(count, 3)
    return {"mu": mu, "g": np.broadcast_to(TURN, (count, 3, 3))}


def momenta_of(count: int) -> dict[str, np.ndarray]:
    return {"mu": bodies_of(count)["mu"]}


def orbits_of(count: int) -> dict[str, np.ndarray]:
    """Bound ones."""
    x = 0.1 * spread(count, 4)
    return {"q": np.array([0.5, 0.0]) + x[:, :2], "p": np.array([0.0, 1.5]) + x[:, 2:]}


@lm.record
class Widening(lm.TimeScale):
    """1/4 + |q|^2, without powers."""

    parts: ClassVar[tuple[str, ...] | None] = ("q",)

    least: float = 0.25

    def value(self, system: Any, state: Any) -> float:
        return self.least + dot(state.q, state.q)


BODY = lm.RigidBody([1.0, 1.5, 2.0])
KEPLER = lm.Kepler()

ON_BODIES = dict(
    states=bodies_of,
    functions=("energy", "mu", tilt),
    events=(first_axis, second_axis, falling),
    ends=(first_axis, third_time),
)
ON_ORBITS = dict(
    states=orbits_of, names=("q", "p"), functions=("energy", far), events=(below, beside), ends=(beside, second_time)
)  # fmt: skip

EQUAL = Scene("equal", BODY, lm.RKMK(order=4), options={"h": 0.3}, by=("start", "inertia", "h"), **ON_BODIES)
COVARIANT = Scene(
    "covariant", BODY, lm.CovariantVariational(lm.Cayley()), options={"h": 0.3}, by=("start", "inertia"), **ON_BODIES
)
TOLERANCE = Scene(
    "tolerance", BODY, lm.RKMK(order=5), options={"rtol": 1e-5, "atol": 1e-8}, first=2.9, rest=7.0, libm=True,
    by=("start", "inertia"), **ON_BODIES,
)  # fmt: skip
FICTIVE = Scene(
    "fictive", KEPLER, lm.ReversibleController(lm.StormerVerlet(), sigma=Widening()), options={"h": 0.2},
    first=2.1, rest=5.0, **ON_ORBITS,
)  # fmt: skip

SWITCHED = lm.PiecewisePolynomial.constant([0.0, 0.31, 0.8, 1.47, 1.5, 20.0], spread(5, 3, 3))


@lm.record
class Torque(lm.Force):
    """A torque that is switched."""

    table: lm.PiecewisePolynomial

    def covector(self, t, xi, g):
        return self.table(t)


def turned(scene: Scene) -> Scene:
    """Backwards, from another time."""
    options = dict(scene.options)
    t0 = 1.25
    if "h" in options:
        options["h"] = -options["h"]
    if scene.by_time:
        return replace(
            scene, name=scene.name + "-back", options=options, t0=t0, first=t0 - scene.first, rest=t0 - scene.rest
        )
    return replace(scene, name=scene.name + "-back", options=options, t0=t0)


def own(scene: Scene) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """What five bodies may have of their own: options of the plan, and of the run."""
    several = {"system": [lm.RigidBody([1.0, 1.5, 2.0 + i / 16.0]) for i in range(5)]}
    if scene is FICTIVE:
        several = {"system": [lm.Kepler(1.0 + i / 16.0) for i in range(5)]}
    h = {"h": [0.2, 0.1, 0.25, 0.125, 0.3]}
    ends = {"t_end": [5.0, 3.5, 7.0, 1.25, 6.0]}
    times = {"t_eval": [[0.25 * (k + 1) * x for x in ends["t_end"]] for k in range(4)]}
    found: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "inertias": (several, {}),
        "steps": (h, {}),
        "inertias+steps": (several | h, {}),
    }
    if scene is EQUAL:
        ways = {"method": [lm.MoserVeselov() for _ in range(5)]}
        found["steps+end"] = ({"h": [0.2, 0.1, 0.25, 0.125, 0.5]}, {"steps": None, "t_end": 2.0})
        found["inertias+methods"] = (several | ways, {})
    else:
        found["ends"] = ({}, ends)
        found["inertias+ends"] = (several, ends)
        found["ends+times"] = ({}, ends | times)
    if scene is TOLERANCE:
        found["tolerances"] = ({"rtol": [1e-4, 1e-5, 1e-6, 1e-7, 1e-8], "max_step": [0.5, 9.0, 9.0, 9.0, 0.25]}, {})
        found["first steps"] = ({"h": [0.5, 0.25, 0.125, 0.75, 1.0]}, {})
    if scene is FICTIVE:
        ways = [lm.ReversibleController(lm.StormerVerlet(), sigma=Widening(0.25 + i / 8.0)) for i in range(5)]
        found["methods"] = ({"method": ways}, {})
    return found


# ---------------------------------------------------------------- tables that jump

LOADED = lm.MechanicalSystem(BODY, lm.NoPotential(), load=Torque(SWITCHED))
TABLE = Scene("table", LOADED, lm.LieVerlet(lm.Cayley()), options={"h": 0.11}, **ON_BODIES)
TABLE_TOLERANCE = Scene(
    "table-tolerance", LOADED, lm.RKMK(order=5), options={"rtol": 1e-4, "atol": 1e-7}, first=1.1, rest=2.5, libm=True, **ON_BODIES
)  # fmt: skip


# ---------------------------------------------------------------- runs that fail


@lm.record
class Fragile(lm.Hamiltonian):
    """A free body whose velocity has no value where mu_2 is large."""

    inertia: lm.Vec
    most: float

    def energy(self, mu):
        return 0.5 * dot(mu, mu / self.inertia)

    def gradient(self, mu):
        if mu[1] > self.most:
            raise RuntimeError("the body is broken")
        return mu / self.inertia


@lm.record
class Exploding(lm.GroupEquation):
    """x' = (x_1^2, x_1 x_2 / 4), which leaves every bound."""

    def velocity(self, t, x):
        return vec(x[0] * x[0], 0.25 * x[0] * x[1])


def growing(count: int) -> dict[str, np.ndarray]:
    """Some of them reach infinity within the run."""
    return {"g": np.array([0.75, 0.5]) + 0.75 * spread(count, 2, 1)}


def coordinate(t, state):
    return state.g[0] - 1.25


def ratio(t, state):
    return state.g[1] / state.g[0]


FRAGILE = lm.LiePoissonSystem(lm.SO3(), Fragile([1.0, 1.5, 2.0], 0.6))
PLANE = Exploding(lm.VectorSpace(2))
ON_PLANES = dict(states=growing, names=("g",), functions=(ratio,), events=(coordinate,), ends=(coordinate,))
FAILING = (
    Scene("fragile-equal", FRAGILE, lm.RKMK(order=4), options={"h": 0.3}, alone=1, **{**ON_BODIES, "functions": ("energy",)}),
    Scene("fragile-tolerance", FRAGILE, lm.RKMK(order=5), options={"rtol": 1e-5}, first=2.9, rest=7.0, libm=True,
          alone=1, **{**ON_BODIES, "functions": ("energy",)}),
    Scene("exploding-equal", PLANE, lm.RKMK(order=4), options={"h": 0.25}, **ON_PLANES),
    Scene("exploding-tolerance", PLANE, lm.RKMK(order=8), options={"rtol": 1e-4, "atol": 1e-4}, first=1.0, rest=4.0,
          libm=True, **ON_PLANES),
    Scene("no-solution", BODY, lm.LiePoissonHamiltonJacobi(order=4, retraction=lm.Exponential()), options={"h": 5.0}, alone=4,
          libm=True, **ON_BODIES),
    Scene("outside-chart", BODY, lm.LiePoissonHamiltonJacobi(order=4, retraction=lm.Exponential()), options={"h": 8.0}, alone=2,
          libm=True, **ON_BODIES),
)  # fmt: skip


# ---------------------------------------------------------------- methods of every kind


def tops_of(count: int) -> dict[str, np.ndarray]:
    """A heavy top."""
    return {"mu": bodies_of(count)["mu"], "g": np.broadcast_to(TURN, (count, 3, 3))}


def pendulums_of(count: int) -> dict[str, np.ndarray]:
    """Below the point they hang from."""
    places = np.array([[0.6, 0.0, -0.8], [0.0, -0.6, -0.8], [0.48, 0.36, -0.8]])[np.arange(count) % 3]
    speeds = np.array([[0.0, 1.25, 0.0], [0.75, 0.0, 0.0], [-0.375, 0.5, 0.0]])[np.arange(count) % 3]
    return {"q": places, "p": speeds}


def spheres_of(count: int) -> dict[str, np.ndarray]:
    given = pendulums_of(count)
    return {"mu": given["p"], "g": given["q"]}


@lm.record
class Sphere(lm.Constraint):
    """A point of R^3 on a sphere."""

    radius: float

    def value(self, g):
        return vec(dot(g, g) - self.radius * self.radius)


@lm.record
class Height(lm.Potential):
    weight: float

    def energy(self, g):
        return self.weight * g[2]


TOP = lm.models.HeavyTop([1.0, 1.25, 0.75], 0.5, [0.125, 0.25, 0.5])
POINT = lm.ConstrainedBody(
    lm.MechanicalSystem(lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0])), Height(1.0)),
    Sphere(1.0),
)


def _method(name: str, system: Any, method: Any, states: Any, h: float, **rest: Any) -> Scene:
    return Scene(name, system, method, states, options={"h": h}, first=6, rest=7, **rest)


def _adaptive(name: str, system: Any, method: Any, states: Any, **rest: Any) -> Scene:
    options = {"rtol": 1e-5, "atol": 1e-8}
    return Scene(name, system, method, states, options=options, first=0.9, rest=2.3, libm=True, **rest)


METHODS = (
    _method("rkmk4 on momenta", BODY, lm.RKMK(order=4), momenta_of, 0.2),
    _method("rkmk8", BODY, lm.RKMK(order=8), bodies_of, 0.2),
    _method("rkmk implicit", BODY, lm.RKMK(tableau=lm.tableaus.gauss(2)), bodies_of, 0.2),
    _method("variational exp", BODY, lm.CovariantVariational(lm.Exponential()), bodies_of, 0.2),
    _method("variational of order 4", BODY, lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4), bodies_of, 0.2),
    _method("hamilton-jacobi 4", BODY, lm.LiePoissonHamiltonJacobi(order=4, retraction=lm.Exponential()), bodies_of, 0.2),
    _method("commutator-free", TOP, lm.CommutatorFree(order=4), tops_of, 0.1),
    _method("lie-verlet", TOP, lm.LieVerlet(), tops_of, 0.1),
    _method("moser-veselov", BODY, lm.MoserVeselov(), bodies_of, 0.1),
    _method("three rotations", BODY, lm.ThreeRotations(), bodies_of, 0.2, libm=True),
    _method("isospectral", BODY, lm.Isospectral(order=4), momenta_of, 0.2),
    _method("midpoint", BODY, lm.ImplicitMidpoint(), momenta_of, 0.1),
    _method("leapfrog of order 6", KEPLER, lm.Composition(lm.StormerVerlet(), order=6), orbits_of, 0.1),
    _method("rattle", lm.SphericalPendulum(), lm.RATTLE(), pendulums_of, 0.05),
    _method("lie-rattle", POINT, lm.LieRATTLE(), spheres_of, 0.05),
    _method("taylor", BODY, lm.Taylor(order=6), bodies_of, 0.2),
    _adaptive("adaptive taylor", BODY, lm.Taylor(order=8), bodies_of),
    _adaptive("adaptive rkmk8", TOP, lm.RKMK(order=8), tops_of),
    _adaptive("adaptive kepler", KEPLER, lm.RKMK(order=5), orbits_of),
    _method("logarithmic", lm.LogarithmicHamiltonian(KEPLER), lm.StormerVerlet(first="drift"), orbits_of, 0.1),
    _method("transformed", lm.TimeTransformed(KEPLER, Widening()), lm.AdaptiveVerlet(), orbits_of, 0.1),
    _method("sundman", lm.SundmanTransformed(KEPLER, Widening()), lm.RKMK(order=4), orbits_of, 0.2),
    _method("controlled variational", BODY,
            lm.ReversibleController(lm.CovariantVariational(lm.Cayley()), lm.time_scales.EqualArc()), bodies_of, 0.2),
)  # fmt: skip


# ---------------------------------------------------------------- many sites, links in memory


def spins_of(count: int) -> dict[str, np.ndarray]:
    """A ring of five, more than are written out."""
    return {"mu": spread(5 * count, 3).reshape(count, 5, 3)}


SPINS = lm.LiePoissonSystem(lm.SO3() ** 5, lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5))))
RODS = lm.joints.chain(3)


def rods_of(count: int) -> dict[str, np.ndarray]:
    """Bent, and let go."""
    start = RODS.state(angles={0: [0.9, 0.1, 0.3]}, rates={1: [1.5, -0.4, 0.2]})
    return {name: np.stack([x] * count) for name, x in start.arrays.items()}


OF_SITES = (
    _method("rods", RODS, lm.LieRATTLE(), rods_of, 0.01),
    _method("spins", SPINS, lm.RKMK(order=2), spins_of, 0.05),
    _method("spins by colours", SPINS, lm.SublatticeSplitting(), spins_of, 0.05),
)


# ---------------------------------------------------------------- what a few files share


class Equator:
    """mu_1 passes zero."""

    terminal = 3

    def __call__(self, t: float, state: Any) -> float:
        return state.mu[0]


def python_first(monkeypatch: pytest.MonkeyPatch, pieces: int) -> None:
    """Some pieces of the next run in plain Python."""
    ready, asked = Execution.ready, []

    def not_yet(execution: Any, done: float) -> bool:
        asked.append(done)
        return len(asked) > pieces and ready(execution, done)

    monkeypatch.setattr(Execution, "ready", not_yet)
