"""Systems of sites made by hand, whose formulas meet, and the driver of runs called for them."""

from __future__ import annotations

from typing import Any

import numpy as np

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.sites.planes import Planes, load
from liemech.compiler.sites.site_calls import SiteCalls
from liemech.formulas import sqrt
from liemech.formulas.classes.layouts import carried_layout, layout_of, leaves
from liemech.formulas.numbers.conversions import fitted, rounded
from liemech.formulas.sites import SiteTable, meet, one_site, padded, rows_of
from liemech.formulas.vectors import small
from liemech.rooms.sites.runs.driver import PLACE, Beginner, Procedure, Shown, advance_sites, begin_sites
from liemech.simulation.compiled.control import FRESH, LIMIT
from liemech.simulation.compiled.prepared import Steps
from liemech.simulation.runs.equal import Equal
from liemech.systems.lie_poisson import BodyState


@lm.record
class Field(lm.Hamiltonian):
    """Spins in a field, and in that of the neighbours of a table."""

    near: SiteTable
    B: lm.Vec

    def energy(self, mu: Any) -> float:
        return 0.0

    def gradient(self, mu: Any) -> Any:
        others = meet(mu)
        return others.sum(self.near, lambda b, d: -b, -self.B)


@lm.record
class Everyone(lm.Hamiltonian):
    """Each on the other, as gravity."""

    B: lm.Vec

    def energy(self, mu: Any) -> float:
        return 0.0

    def pull(self, mu: Any, b: Any) -> Any:
        r = mu - b
        square = lm.dot(r, r)
        return r / (square * sqrt(square))

    def gradient(self, mu: Any) -> Any:
        others = meet(mu)
        return others.pairs(lambda a, b: (self.pull(a, b), self.pull(b, a)), -self.B)


@lm.record
class Springs(lm.Potential):
    """Attitudes that are drawn to those of the neighbours: V = -k sum tr(g^T g_j)."""

    near: SiteTable
    k: float

    def energy(self, g: Any) -> float:
        return 0.0

    def pair(self, g: Any, other: Any) -> float:
        return -self.k * lm.sum([lm.dot(g[i], other[i]) for i in range(3)])

    def pull(self, group: Any, g: Any, other: Any) -> Any:
        turned = lambda eta: self.pair(group.compose_exp(g, eta), other)  # noqa: E731
        return -lm.gradient(turned, lm.vec(0.0, 0.0, 0.0))

    def force(self, group: Any, g: Any) -> Any:
        others = meet(g)
        return others.sum(self.near, lambda b, d: self.pull(group, g, b), lm.vec(0.0, 0.0, 0.0))


def ring(n: int, fixed: bool = True) -> SiteTable:
    i = np.arange(n)
    return SiteTable.of(np.array([(i + 1) % n, (i - 1) % n]), fixed)


def spins(n: int) -> np.ndarray:
    s = np.random.default_rng(1).normal(size=(n, 3)) * 0.3 + [0.0, 0.0, 1.0]
    return s / np.linalg.norm(s, axis=1)[:, None]


def turned(n: int) -> np.ndarray:
    return np.asarray(lm.SO3().exp(np.random.default_rng(3).normal(size=(n, 3))))


def run(method: Any, system: Any, mu: np.ndarray, g: np.ndarray | None, h: float, steps: int, lanes: int) -> np.ndarray:
    """Samples after every step, (steps, width, sites); lanes 0: plain Python."""
    n = len(mu)
    states = [BodyState(small(m), None if g is None else small(g[i])) for i, m in enumerate(mu)]
    way = Steps(system, method, h, 1, None, "double", None, None, 1)
    given, started = layout_of(states[0]), layout_of(way.remembering(states[0]))
    starts = Planes(rows_of(np.array([leaves(s, given) for s in states]).T), n)
    carry = one_site(n, 0, lambda: method.start(system, fitted(load(starts, 0, given), started), h))
    memory, shown = carried_layout(carry), layout_of(rounded(method.observe(carry)))
    sites, seen = Planes.of_rows(2 * memory.width, n), Planes.of_rows(steps * shown.width, n)
    goals, clocks = np.array([np.inf, 0, 0, 0, 0, 0.0]), np.array([0.0, h, *FRESH])
    goals[LIMIT] = steps
    place, out, done = np.zeros(1), np.zeros(1), np.zeros(1)
    shared = np.zeros(1), np.append(h * np.arange(1.0, steps + 1.0), np.nan), np.zeros(4)
    start = Beginner(method, given, started, memory), system, h, starts, sites
    samples = Shown(True, False, shown, (), layout_of(()))
    step = Procedure(method, Equal(), memory, PLACE, samples, False, None), system, steps, sites, seen
    if lanes:
        rest = *map(kernel.Shared, shared), goals, place, clocks, out
        calls = [
            SiteCalls(kernel.kernel(driver, *arguments, lanes=lanes), n)
            for driver, arguments in ((begin_sites, (*start, done, None)), (advance_sites, (*step, *rest, None)))
        ]
        calls[0](*start, done, None)
        calls[1](*step, *rest, None)
    else:
        begin_sites(*start, done, [])
        advance_sites(*step, *shared, goals, place, clocks, out, [])
    assert done[0] == 1.0
    assert clocks[3] == steps
    return seen.array.reshape(steps, shown.width, padded(n))[:, :, :n]
