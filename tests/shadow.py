"""The modified energy that a splitting keeps, computed to high order: is a trend of the energy a drift, or the
mean of an error that is a function of the state?

A symplectic step is, up to terms beyond all orders, the flow of a modified Hamiltonian H~ = H + h^p H_p + ...
Along that flow, with the velocity xi, the action grows as dS = <mu, xi> dt - H~ dt, so that

    H~ = <mu, xi> - dS/dt.

Steps give elements and actions at t = n h: a drift adds T a h to the action (T is quadratic in the momentum), a
kick -V b h.  The polynomial through 2 k + 1 of them gives xi and dS/dt at the one in the middle, up to h^(2 k).

Source: Skeel and Hardy, Practical construction of modified Hamiltonians, SIAM J. Sci. Comput. 23 (2001);
Engle, Skeel and Drees, Monitoring energy drift with shadow Hamiltonians, J. Comput. Phys. 206 (2005).
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

import liemech as lm

SIDE = 18
"""Steps on either side."""

SHORT = 0.8, 1.0
"""Of the steps by which a modified energy is found that belongs to longer ones."""


def weights(side: int) -> np.ndarray:
    """Of the places 1, 2, ..., side in the derivative at 0 of the polynomial through -side, ..., side; those of
    -1, -2, ... have the other sign.
    """
    f = math.factorial
    return np.array([(-1) ** (k + 1) * f(side) ** 2 / (k * f(side - k) * f(side + k)) for k in range(1, side + 1)])


def apart(g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses as rotations alone, and matrices that add the places."""
    place = np.zeros_like(g)
    place[..., :3, 3] = g[..., :3, 3]
    return g - place, place


class Shadow:
    """H~ - H of rigid bodies in a field, for steps of `KickDrift`, in the units of the system.

    moments : inertias and masses of a body, (6,).
    """

    def __init__(self, system: Any, method: Any, h: float, moments: Any, side: int = SIDE) -> None:
        self.system, self.tableau, self.h, self.side = system, method.tableau, h, side
        self.J = np.array(moments)
        self.body = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy(self.J.tolist()))
        self.free = {a: lm.Plan(self.body, method.free, h=a * h, progress=False) for a in {*method.tableau.drifts}}

    def drift(self, a: float, mu: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All bodies of all members, free for a time a h."""
        start = self.body.state(mu=mu.reshape(-1, 6), g=g.reshape(-1, 4, 4))
        run = self.free[a].run(start, steps=1)
        return np.asarray(run.mu)[-1].reshape(mu.shape), np.asarray(run.g)[-1].reshape(g.shape)

    def steps(self, mu: np.ndarray, g: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Rotations with the ways from the start, and actions, step by step.  (Of places that are far
        away the rounding would be seen.)
        """
        table, h, none = self.tableau, self.h, np.zeros_like(mu)
        (g, start), action = apart(g), np.zeros(len(mu))
        for _ in range(self.side):
            for i, b in enumerate(table.kicks):
                if b:
                    there = g + start
                    mu = mu + b * h * self.system.force(there)
                    action = action - b * h * self.system.energy(none, there)
                if i < len(table.drifts):
                    a = table.drifts[i]
                    action = action + 0.5 * a * h * (mu**2 / self.J).sum(axis=(1, 2))
                    mu, g = self.drift(a, mu, g)
            yield g, action

    def __call__(self, mu: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Of some members, (members, sites, 6) and (members, sites, 4, 4)."""
        back, w = np.swapaxes(apart(g)[0], -1, -2), weights(self.side) / self.h
        hat, rate = np.zeros_like(g), np.zeros(len(mu))
        for sign in (1.0, -1.0):  # the way back is that of momenta turned round
            for c, (there, action) in zip(w, self.steps(sign * mu, g), strict=True):
                hat += sign * c * (back @ there)
                rate += c * action
        turning = 0.5 * (hat - np.swapaxes(hat, -1, -2))
        xi = [turning[..., i, j] for i, j in ((2, 1), (0, 2), (1, 0))]
        xi += [hat[..., i, 3] for i in range(3)]
        found = (mu * np.stack(xi, axis=-1)).sum(axis=(1, 2)) - rate
        return found - self.system.energy(mu, g)


def beyond(system: Any, method: Any, h: float, moments: Any, short: float) -> Any:
    """H~ - H as a function of states; of steps longer than `short` from those of two shorter ones, as
    h^p (H_p + h^2 H_(p+2)).
    """
    if h <= short:
        return Shadow(system, method, h, moments)
    lengths = short * np.array(SHORT)
    ways = [Shadow(system, method, x, moments) for x in lengths]
    x = (lengths / h) ** 2
    p = method.order // 2
    powers = np.stack([x**p, x ** (p + 1)], axis=1)

    def found(mu: np.ndarray, g: np.ndarray) -> np.ndarray:
        total: np.ndarray = np.linalg.solve(powers, [way(mu, g) for way in ways]).sum(axis=0)
        return total

    return found
