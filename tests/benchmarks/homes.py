"""This library in the races of the leader board: its quickest methods for each, and the closed
forms where there are some.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from races import BLOCKS, FOUR, MOMENTS, PULL, SUNS, TOP_LOAD, TOP_MOMENTS, Race, matrices
from rivals import Entry, Run, doubled, tolerances

import liemech as lm
from liemech import formulas
from liemech.formulas import cos, sin
from liemech.tableaus import DOP853, KAHAN_LI8, SPLITTINGS, VERNER6, SplittingTableau

Start = tuple[Any, Any]  # a system and its state
WARM = 1.0
"""Seconds of a closed form, after which native code for it, that is made when it pays, is there."""


@lm.record
class Drive(lm.LinearGroupEquation):
    """g' = g xi(t) of `races.driven`."""

    def drive(self, t: float) -> lm.Vec:
        return lm.vec(cos(2.0 * t), sin(t), 1.0 + 0.5 * cos(3.0 * t))


def square(g: np.ndarray, n: int) -> np.ndarray:
    """The upper left corners, (count, n n)."""
    return g[:, :n, :n].reshape(len(g), -1)


def entries(race: Race) -> list[Entry]:
    """Our methods for a race."""
    return TABLE[race.key](race)


def fixed(
    race: Race, name: str, at: Start, method: Any, settings: tuple[float, ...], outputs: Callable[..., np.ndarray],
    parts: tuple[str, ...] = ("mu", "g"), closed: bool = False,
) -> Entry:  # fmt: skip
    """Fixed steps, so many between two outputs, and down to an eighth as many."""
    fewest = max(1, round(settings[0]) // 8)
    settings = (*[n for n in doubled(1, 20) if fewest <= n < settings[0]], *settings)

    def prepare(setting: float) -> Run:
        every, (system, start) = round(setting), at
        h = race.end / race.count / every
        chosen = method(h) if callable(method) else method
        plan = lm.Plan(system, chosen, h=h, every=every, record=parts, compiled=True, progress=False)

        def run() -> Any:
            motion: Any = plan.run(start, steps=every * race.count)
            return [getattr(motion, part) for part in parts]

        return run

    return Entry("liemech", name, settings, prepare, lambda found: outputs(*[x[1:] for x in found]), closed)


def adaptive(
    race: Race, name: str, at: Start, method: Any, outputs: Callable[..., np.ndarray], parts: tuple[str, ...] = ("mu", "g"),
    settings: tuple[float, ...] = tolerances(-3, -14)[::2], **options: Any,
) -> Entry:  # fmt: skip
    """Steps that follow a tolerance."""
    grid = np.array([0.0, *race.times])

    def prepare(tolerance: float) -> Run:
        system, start = at
        plan = lm.Plan(
            system, method, rtol=tolerance, atol=tolerance, record=parts, compiled=True, progress=False, **options
        )

        def run() -> Any:
            motion: Any = plan.run(start, t_end=race.end, t_eval=grid)
            return [getattr(motion, part) for part in parts]

        return run

    return Entry("liemech", f"{name}, adaptive", settings, prepare, lambda found: outputs(*[x[1:] for x in found]))


ORDERS = 6, 8, 10, 12, 15, 18, 22
"""Of Taylor series; other packages choose theirs by the tolerance."""


def plain(race: Race, orders: tuple[int, ...] = ORDERS, follow: bool = False) -> list[Entry]:
    """Taylor series of the equations in R^n as all other packages have them: no group, and nothing
    kept but what the order keeps.

    follow : do steps follow a tolerance?
    """

    @lm.record
    class Plain(lm.GroupEquation):
        def velocity(self, t: float, y: lm.Vec) -> lm.Vec:
            return lm.vec(*race.rates(formulas, t, y))

    n = len(race.start)
    system = Plain(lm.VectorSpace(n))
    at = system, system.state(race.start)

    def entry(order: int) -> Entry:
        what = race, f"Taylor {order}, R^{n}", at, lm.Taylor(order)
        if follow:
            return adaptive(*what, race.outputs, ("g",))
        return fixed(*what, doubled(1, 7), race.outputs, ("g",))

    return [entry(order) for order in orders]


def exact(race: Race, at: Start, outputs: Callable[..., np.ndarray], parts: tuple[str, ...]) -> Entry:
    """The closed form at all outputs, its native code made beforehand, as that of others is."""

    def prepare(_: float) -> Run:
        system, start = at

        def run() -> Any:
            states = system.exact(start, race.times)
            return [np.asarray(getattr(states, part)) for part in parts]

        begun = time.process_time()
        while time.process_time() - begun < WARM:
            run()
        return run

    return Entry("liemech", "closed form", (0.0,), prepare, lambda found: outputs(*found), closed=True)


# ------------------------------------------------------------------ bodies


def free(race: Race) -> list[Entry]:
    """The free rigid body, with or without its attitude, for a short or a long time."""
    body = lm.RigidBody(MOMENTS)
    turns, far = race.key != "momentum", race.end > 1e4
    parts = ("mu", "g") if turns else ("mu",)
    start = body.state(mu=race.start[:3], g=np.eye(3) if turns else None)

    def outputs(mu: np.ndarray, g: np.ndarray | None = None) -> np.ndarray:
        return mu if g is None else np.concatenate([mu, square(g, 3)], axis=1)

    def add(name: str, method: Any, first: int, times: int, closed: bool = False) -> Entry:
        many = doubled(first * (1000 if far and not closed else 1), times)
        return fixed(race, name, (body, start), method, many, outputs, parts, closed)

    return [
        exact(race, (body, start), outputs, parts),
        add("exact flow, step by step", lm.ExactFreeBody(), 1, 2, True),
        add("Moser-Veselov, fitted", lambda h: lm.ExactMoserVeselov.of(body, start, h), 8000 if far else 8, 2, True),
        add("Hamilton-Jacobi 8, exp", lm.LiePoissonHamiltonJacobi(order=8), 4, 4),
        add("three rotations, composed to 8", lm.Composition(lm.ThreeRotations(), order=8), 4, 4),
        add("RKMK DOP853", lm.RKMK(tableau=DOP853), 8, 4),
        add("Taylor 18", lm.Taylor(18), 4, 4),
        add("Taylor 12", lm.Taylor(12), 4, 5),
        *([] if far else [add("Galerkin 8", lm.GalerkinVariational(8), 4, 4)]),
        *([] if far else plain(race)),
    ]


def heavy_top(race: Race) -> list[Entry]:
    """The heavy top, on SO(3) and on se(3)*."""
    top = lm.models.HeavyTop(TOP_MOMENTS, 1.0, TOP_LOAD)
    whole = top.state(mu=race.start[:3], g=matrices(np.array([race.start[3:]])).reshape(3, 3))
    at, dual = (top, whole), (top.reduced, top.reduced.from_top(whole))

    def outputs(mu: np.ndarray, g: np.ndarray) -> np.ndarray:
        return np.concatenate([mu[:, :3], square(g, 3)], axis=1)

    def add(name: str, method: Any, first: int, times: int, where: Start = at) -> Entry:
        return fixed(race, name, where, method, doubled(first, times), outputs)

    return [
        *[add(f"kicks and exact drifts, order {k}", lm.KickDrift(order=k), 32 >> (k // 2), 5) for k in (4, 6, 8)],
        add("Galerkin 8", lm.GalerkinVariational(8), 2, 4),
        add("Hamilton-Jacobi 8, exp, se(3)*", lm.LiePoissonHamiltonJacobi(order=8), 2, 4, dual),
        add("RKMK DOP853, se(3)*", lm.RKMK(tableau=DOP853), 2, 6, dual),
        add("RKMK Verner 6, se(3)*", lm.RKMK(tableau=VERNER6), 4, 5, dual),
        add("Taylor 12, se(3)*", lm.Taylor(12), 2, 5, dual),
        add("Taylor 18, se(3)*", lm.Taylor(18), 1, 5, dual),
        *plain(race),
    ]


def kirchhoff(race: Race) -> list[Entry]:
    """Kirchhoff's body: the inertia is the inverse of the matrix of the energy of the impulse."""
    A, D, M = (np.array(block) for block in BLOCKS)
    body = lm.models.KirchhoffBody(np.linalg.inv(np.block([[A, D], [D.T, M]])))
    g = np.eye(4)
    g[:3, :3], g[:3, 3] = matrices(np.array([race.start[6:10]])).reshape(3, 3), race.start[10:13]
    at = body, body.state(mu=race.start[:6], g=g)

    def outputs(mu: np.ndarray, g: np.ndarray) -> np.ndarray:
        return np.concatenate([mu, square(g, 3), g[:, :3, 3]], axis=1)

    return [
        fixed(race, "Hamilton-Jacobi 6, exp", at, lm.LiePoissonHamiltonJacobi(order=6), doubled(4, 5), outputs),
        fixed(race, "Galerkin 8", at, lm.GalerkinVariational(8), doubled(2, 4), outputs),
        fixed(race, "RKMK DOP853", at, lm.RKMK(tableau=DOP853), doubled(2, 6), outputs),
        fixed(race, "RKMK Verner 6", at, lm.RKMK(tableau=VERNER6), doubled(4, 5), outputs),
        fixed(race, "Taylor 12", at, lm.Taylor(12), doubled(2, 5), outputs),
        fixed(race, "Taylor 18", at, lm.Taylor(18), doubled(2, 5), outputs),
        *plain(race),
    ]


def four_dimensions(race: Race) -> list[Entry]:
    """The free body on SO(4)."""
    system = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy(lm.vec(*FOUR)))
    at = system, system.state(race.start[:6], np.eye(4))

    def outputs(mu: np.ndarray, g: np.ndarray) -> np.ndarray:
        return np.concatenate([mu, square(g, 4)], axis=1)

    return [
        fixed(
            race, "Hamilton-Jacobi 4, Cayley", at, lm.LiePoissonHamiltonJacobi(4, lm.Cayley()), doubled(16, 4), outputs
        ),
        fixed(race, "Galerkin 6, exp", at, lm.GalerkinVariational(6), doubled(8, 4), outputs),
        fixed(race, "RKMK DOP853", at, lm.RKMK(tableau=DOP853), doubled(4, 6), outputs),
        fixed(race, "Taylor 12", at, lm.Taylor(12), doubled(4, 5), outputs),
        *plain(race),
    ]


def driven(race: Race) -> list[Entry]:
    """A rotation driven by a velocity that is given."""
    matrix, unit = Drive(lm.SO3()), Drive(lm.UnitQuaternions())
    at, turn = (matrix, matrix.state(g=np.eye(3))), (unit, unit.state(unit.group.identity()))

    def rotations(g: np.ndarray) -> np.ndarray:
        return matrices(np.roll(g, 1, axis=1))  # here the scalar part is the last

    def add(name: str, where: Start, method: Any, first: int, times: int) -> Entry:
        outputs = partial(square, n=3) if where is at else rotations
        return fixed(race, name, where, method, doubled(first, times), outputs, ("g",))

    return [
        add("Magnus 4", at, lm.Magnus(4), 32, 5),
        add("Magnus 6", at, lm.Magnus(6), 16, 6),
        add("Magnus 6, quaternion", turn, lm.Magnus(6), 16, 6),
        add("RKMK DOP853", at, lm.RKMK(tableau=DOP853), 8, 5),
        add("Taylor 12, quaternion", turn, lm.Taylor(12), 8, 4),
        add("Taylor 18, quaternion", turn, lm.Taylor(18), 4, 4),
        *plain(race),
    ]


# ------------------------------------------------------------------ points


def kepler(race: Race) -> list[Entry]:
    """An ellipse with e = 0.9."""
    system = lm.Kepler()
    start, parts = system.state(race.start[:2], race.start[2:]), ("q", "p")
    at = system, start
    eight = lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI8).exchanged)
    grid = np.array([0.0, *race.times])

    def outputs(q: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([q, p], axis=1)

    def transformed(name: str, place: Any, method: Any, settings: tuple[float, ...]) -> Entry:
        def prepare(setting: float) -> Run:
            plan = lm.Plan(place, method, h=setting, record=parts, compiled=True, progress=False)

            def run() -> Any:
                motion: Any = plan.run(start, t_end=race.end, t_eval=grid)
                return [motion.q, motion.p]

            return run

        return Entry("liemech", name, settings, prepare, lambda found: outputs(*[x[1:] for x in found]))

    halved = tuple(0.8 / 2**k for k in range(7))
    return [
        exact(race, at, outputs, parts),
        transformed("logarithmic, Kahan-Li 8", lm.LogarithmicHamiltonian(system), eight, halved[2:]),
        transformed(
            "controller, splitting 8",
            system,
            lm.ReversibleController(lm.Splitting(order=8), lm.time_scales.DistancePower(1.5)),
            halved,
        ),
        adaptive(race, "Taylor 12", at, lm.Taylor(12), outputs, parts),
        adaptive(race, "Taylor 18", at, lm.Taylor(18), outputs, parts),
        *plain(race, (8, 12, 15, 18, 22), follow=True),
    ]


def spherical_pendulum(race: Race) -> list[Entry]:
    """A point on a sphere."""
    system = lm.SphericalPendulum(gravity=9.81)
    at = system, system.state(race.start[:3], race.start[3:])

    def outputs(q: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([q, p], axis=1)

    def add(name: str, method: Any, first: int, times: int) -> Entry:
        return fixed(race, name, at, method, doubled(first, times), outputs, ("q", "p"))

    return [
        *[add(f"geodesics, order {k}", lm.GeodesicSplitting(order=k), 4, 7) for k in (4, 6, 8)],
        add("RATTLE, order 8", lm.Composition(lm.RATTLE(), order=8), 4, 6),
        add("Lobatto 6", lm.LobattoPair(order=6), 8, 6),
        *plain(race),
    ]


def solar_system(race: Race) -> list[Entry]:
    """The outer planets: Kepler's motions and what planets do to each other, or plain equations."""
    system, bodies = (lm.models.PlanetarySystem(SUNS, PULL), lm.models.NBody(masses=SUNS, gravity=PULL))
    first, masses = np.array(race.start), np.repeat(SUNS, 3)
    q, p = first[:18], masses * first[18:]
    split, plain = (system, system.state_of(q, p)), (bodies, bodies.state(q, p))

    def places(y: np.ndarray) -> np.ndarray:
        return np.asarray(system.bodies(y)[0])

    settings = doubled(1, 9)
    tableaus = {"SABA (8, 2)": "SABA (8, 2)", "ABA (10, 6, 4)": "ABA (10, 6, 4)"}
    return [
        *[
            fixed(race, f"splitting {name}", split, lm.Splitting(tableau=SPLITTINGS[key]), settings, places, ("y",))
            for name, key in tableaus.items()
        ],
        fixed(race, "kicks and drifts, order 8", plain, lm.Splitting(order=8), settings, lambda q, p: q, ("q", "p")),
    ]


TABLE: dict[str, Callable[[Race], list[Entry]]] = {
    "momentum": free,
    "attitude": free,
    "long": free,
    "top": heavy_top,
    "fish": kirchhoff,
    "kepler": kepler,
    "pendulum": spherical_pendulum,
    "planets": solar_system,
    "four": four_dimensions,
    "driven": driven,
}
