"""Optimal control with few nodes: variational steps beside Runge-Kutta steps of the same number.

    python tests/benchmarks/slew.py [--quick]

Each node is one step, over which the input is held, or a straight line.  SciPy's SLSQP finds the cheapest inputs that
end at rest at the target, for both sides with exact derivatives: `plan.gradient` and `plan.pullback` through our steps,
complex steps through explicit Runge-Kutta steps of quaternion, place and momenta (direct shooting).  The inputs are
then replayed by an accurate run, which tells by how much they miss.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import minimize

import liemech as lm

J, M = np.array([1.0, 1.5, 2.0]), 3.0
AIM = lm.SO3().exp([0.0, 0.0, 2.0]) @ lm.SO3().exp([1.0, 0.0, 0.0])
PLACE = np.array([4.0, 0.0, 0.0])
BALL, HEIGHT, WIDTH = np.array([2.0, 0.2, 0.1]), 2.0, 0.6
ARRAY = Any


@lm.record
class Thrust(lm.Force):
    """A force of time."""

    table: lm.PiecewisePolynomial

    def covector(self, t: Any, xi: Any, g: Any) -> Any:
        return self.table(t)


@lm.record
class Ball(lm.Potential):
    """A smooth obstacle."""

    height: float

    def energy(self, g: Any) -> Any:
        x = lm.vec(g[0][3] - BALL[0], g[1][3] - BALL[1], g[2][3] - BALL[2])
        return self.height * lm.formulas.exp(-0.5 * lm.dot(x, x) / WIDTH**2)


def height_at(x: ARRAY) -> ARRAY:
    """The obstacle, of places (..., 3)."""
    d = x - BALL
    return HEIGHT * np.exp(-0.5 * (d * d).sum(-1) / WIDTH**2)


class Problem:
    """From rest to rest at the target in a time T, on SO(3) or, past the obstacle, on SE(3)."""

    def __init__(self, flies: bool, T: float) -> None:
        self.flies, self.T = flies, T
        self.m = 6 if flies else 3
        self.begin = np.zeros(self.m)
        self.free = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([*J, M, M, M])) if flies else lm.RigidBody(J)

    def missed(self, R: ARRAY, mu: ARRAY, x: ARRAY) -> ARRAY:
        """What must be nought at the end: the momenta, the skew part of aim^T R, the place."""
        A = AIM.T @ R
        skew = 0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])
        return np.concatenate([mu, skew, x - PLACE] if self.flies else [mu, skew])


class Ours:
    """Steps of ours, with gradients of ours."""

    def __init__(self, problem: Problem, nodes: int, method: Any) -> None:
        self.problem, self.nodes, self.h, self.method = (problem, nodes, problem.T / nodes, method)

    def plan(self, u: ARRAY, method: Any, parts: int = 1) -> tuple[Any, Any]:
        p = self.problem
        t = self.h * np.arange(self.nodes + 1)
        made = "constant" if len(u) == self.nodes else "linear"
        table = getattr(lm.PiecewisePolynomial, made)(t, u)
        body = lm.MechanicalSystem(p.free, lm.NoPotential(), load=Thrust(table))
        start = body.state(mu=p.begin, g=np.eye(4 if p.flies else 3))
        return lm.Plan(body, method, self.h / parts), start

    def end(self, u: ARRAY) -> tuple[ARRAY, ARRAY]:
        p, (plan, start) = self.problem, self.plan(u, self.method)
        last = plan.run(start, steps=self.nodes).last
        g = np.array(last.g)
        R, rows = g[:3, :3], []
        A = AIM.T @ R
        for k in range(p.m + 3 + 3 * p.flies):
            e = np.zeros(2 * p.m)
            if k < p.m:
                e[k] = 1.0
            elif k < p.m + 3:  # of the skew part: 1/2 (tr(A) - A^T) in the frame of eta
                e[p.m : p.m + 3] = 0.5 * (np.trace(A) * np.eye(3) - A.T)[k - p.m]
            else:
                e[p.m + 3 :] = R[k - p.m - 3]
            found = plan.pullback(e, start, steps=self.nodes, by="table.values")
            rows.append(found["table.values"].ravel())
        return p.missed(R, np.array(last.mu), g[:3, -1]), np.array(rows)

    def obstacle(self, u: ARRAY) -> tuple[float, ARRAY]:
        if not self.problem.flies:
            return 0.0, np.zeros_like(u)
        plan, start = self.plan(u, self.method)
        ball = Ball(HEIGHT)
        found = plan.gradient(
            lambda s: 0.0 * s.mu[0],
            start,
            steps=self.nodes,
            by="table.values",
            along=lambda s: ball.energy(s.g),
            every=1,
        )
        return found.value, found["table.values"]

    def replayed(self, u: ARRAY) -> tuple[float, float]:
        """How far the inputs miss, and the integral over the obstacle, by steps of order 8."""
        p, parts = self.problem, max(4, 400 // self.nodes)
        plan, start = self.plan(u, lm.RKMK(order=8), parts)
        run = plan.run(start, steps=self.nodes * parts)
        g = np.asarray(run.g)
        miss = p.missed(g[-1][:3, :3], np.asarray(run.mu)[-1], g[-1][:3, -1])
        V = height_at(g[:, :3, 3]) if p.flies else np.zeros(len(g))
        return float(np.linalg.norm(miss)), float(V.sum() * self.h / parts)


class RungeKutta:
    """Explicit steps of quaternion, place, and momenta: of the turn in the body, else in space."""

    def __init__(self, problem: Problem, nodes: int, order: int) -> None:
        self.problem, self.nodes, self.order, self.h = problem, nodes, order, problem.T / nodes
        self.start = np.concatenate([[1.0, 0.0, 0.0, 0.0], np.zeros(3), problem.begin])
        if not problem.flies:
            self.start = np.delete(self.start, [4, 5, 6])

    def rate(self, z: ARRAY, u: ARRAY) -> ARRAY:
        at = 7 if self.problem.flies else 4
        (a, b, c, d), P = np.moveaxis(z[..., :4], -1, 0), z[..., at : at + 3]
        w = P / J
        x, y, s = np.moveaxis(w, -1, 0)
        q = [-b * x - c * y - d * s, a * x + c * s - d * y, a * y + d * x - b * s]
        q = 0.5 * np.stack([*q, a * s + b * y - c * x], -1)
        turn = np.cross(P, w) + u[..., :3]
        if not self.problem.flies:
            return np.concatenate([q, turn], -1)
        force = np.einsum("...ij,...j->...i", rotation(z[..., :4]), u[..., 3:])
        return np.concatenate([q, z[..., 10:] / M, turn, force], -1)

    def step(self, z: ARRAY, u: ARRAY, v: ARRAY) -> ARRAY:
        h, f, w = self.h, self.rate, 0.5 * (u + v)
        k1 = f(z, u)
        if self.order == 1:
            return z + h * k1
        k2 = f(z + 0.5 * h * k1, w)
        if self.order == 2:
            return z + h * k2
        k3 = f(z + 0.5 * h * k2, w)
        return z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(z + h * k3, v))

    def states(self, u: ARRAY) -> tuple[ARRAY, ARRAY, ARRAY]:
        """All states, and the derivatives of each step by state and input, by complex steps."""
        u, v, z = u[: self.nodes], u[-self.nodes :], [self.start]
        for first, second in zip(u, v, strict=True):
            z.append(self.step(z[-1], first, second))
        n, m = len(self.start), u.shape[1]
        seed = 1e-30j * np.eye(n + 2 * m)
        ends = u[:, None] + seed[:, n : n + m], v[:, None] + seed[:, n + m :]
        moved = self.step(np.array(z[:-1])[:, None] + seed[:, :n], *ends)
        D = np.swapaxes(moved.imag / 1e-30, 1, 2)
        return np.array(z), D[..., :n], D[..., n:]

    def by_inputs(self, rows: ARRAY, u: ARRAY, slope: ARRAY) -> ARRAY:
        """Backwards: rows times the derivatives by the inputs; slope is added on the way."""
        _, A, B = self.states(u)
        m, found = u.shape[1], np.zeros((len(rows), *u.shape))
        for k in range(self.nodes)[::-1]:
            D = rows @ B[k]
            found[:, k] += D[:, :m]
            found[:, k + len(u) - self.nodes] += D[:, m:]
            rows = rows @ A[k] + slope[k]
        return found.reshape(len(rows), -1)

    def end(self, u: ARRAY) -> tuple[ARRAY, ARRAY]:
        z = self.states(u)[0]

        def of(y: ARRAY) -> ARRAY:
            return self.problem.missed(rotation(y[:4]), y[7 if self.problem.flies else 4 :], y[4:7])

        n = z.shape[1]
        rows = np.array([of(z[-1] + 1e-30j * e).imag / 1e-30 for e in np.eye(n)]).T
        return of(z[-1]), self.by_inputs(rows, u, 0.0 * z)

    def obstacle(self, u: ARRAY) -> tuple[float, ARRAY]:
        if not self.problem.flies:
            return 0.0, np.zeros_like(u)
        z = self.states(u)[0]
        V = height_at(z[:, 4:7])
        slope = np.zeros_like(z)
        slope[:, 4:7] = -V[:, None] * (z[:, 4:7] - BALL) / WIDTH**2
        return float(V.sum()), self.by_inputs(slope[-1:], u, slope).reshape(u.shape)


def rotation(q: ARRAY) -> ARRAY:
    """The matrix of a quaternion, (..., 4), that need not be of length 1."""
    a, b, c, d = np.moveaxis(q, -1, 0)
    n = a * a + b * b + c * c + d * d
    rows = [
        [n - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), n - 2 * (b * b + d * d), 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), n - 2 * (b * b + c * c)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2) / n[..., None, None]


def weights(values: int, nodes: int) -> ARRAY:
    """The integral of |u|^2 is h times u, these weights, u."""
    if values == nodes:
        return np.eye(nodes)
    found = np.zeros((values, values))
    for k in range(nodes):
        found[k : k + 2, k : k + 2] += np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    return found


def cheapest(side: Any, u: ARRAY) -> tuple[float, ARRAY, bool]:
    """The least of h sum(|u|^2/2 + V) with the end held, from a first guess; variables are
    sqrt(h) u, of which the effort has the Hessian 1.
    """
    h, shape, root = side.h, u.shape, np.sqrt(side.h)
    effort = weights(len(u), side.nodes)
    remembered: dict[str, Any] = {"w": np.empty(0)}

    def end(w: ARRAY) -> Any:
        if not np.array_equal(w, remembered["w"]):
            remembered.update(w=w.copy(), end=side.end(w.reshape(shape) / root))
        return remembered["end"]

    def cost(w: ARRAY) -> tuple[float, ARRAY]:
        V, slope = side.obstacle(w.reshape(shape) / root)
        by = effort @ w.reshape(shape)
        return 0.5 * w @ by.ravel() + h * V, by.ravel() + root * slope.ravel()

    held = {"type": "eq", "fun": lambda w: end(w)[0], "jac": lambda w: end(w)[1] / root}
    options = {"maxiter": 150, "ftol": 1e-11}
    found = minimize(cost, root * u.ravel(), jac=True, method="SLSQP", constraints=held, options=options)
    good = bool(found.success) and np.abs(end(found.x)[0]).max() < 1e-6
    return float(found.fun), found.x.reshape(shape) / root, good


PROBLEMS: dict[str, tuple[Problem, tuple[int, ...]]] = {
    "slew": (Problem(False, 6.0), (4, 8, 16, 40, 80)),
    "flight": (Problem(True, 6.0), (8, 16, 40)),
}
SIDES: dict[str, Callable[[Problem, int], Any]] = {
    "LieVerlet": lambda p, n: Ours(p, n, lm.LieVerlet()),
    "KickDrift4": lambda p, n: Ours(p, n, lm.KickDrift(order=4)),
    "RKMK4": lambda p, n: Ours(p, n, lm.RKMK(order=4)),
    "Euler": lambda p, n: RungeKutta(p, n, 1),
    "RK2": lambda p, n: RungeKutta(p, n, 2),
    "RK4": lambda p, n: RungeKutta(p, n, 4),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few nodes of each")
    parser.add_argument("--only", help="one of the problems")
    chosen = parser.parse_args()
    for name, (problem, counts) in PROBLEMS.items():
        if chosen.only in (None, name):
            for more in 0, 1:
                print(f"{name}, inputs {('held', 'straight lines')[more]}")
                print(f"{'':10} nodes      cost    replayed   end off by  s")
                for side, made in SIDES.items():
                    compared(problem, side, made, counts[1:2] if chosen.quick else counts, more)
    if chosen.only in (None, "spinning"):
        spinning((25, 50) if chosen.quick else (25, 50, 100, 200, 400, 1000))


def spinning(counts: tuple[int, ...]) -> None:
    """A body that spins at 5 rad/s under a given torque, straight lines from node to node: how far the
    end is off the motion by steps of order 8.
    """
    problem = Problem(False, 6.0)
    problem.begin = np.array([0.3, 0.0, 10.0])
    print(f"spinning body, end off by  {' '.join(f'{n:>9}' for n in counts)}")
    for name, made in SIDES.items():
        found = []
        for nodes in counts:
            t = np.linspace(0.0, problem.T, nodes + 1)
            u = 0.3 * np.stack([np.sin(t), np.cos(2.0 * t), np.sin(0.5 * t)], axis=1)
            ours, side = Ours(problem, nodes, None), made(problem, nodes)
            parts = 4000 // nodes
            plan, start = ours.plan(u, lm.RKMK(order=8), parts)
            wanted = plan.run(start, steps=nodes * parts).last
            if isinstance(side, Ours):
                try:
                    last = side.plan(u, side.method)[0].run(start, steps=nodes).last
                except lm.errors.NoConvergence:
                    found.append(np.nan)
                    continue
                mu, R = np.array(last.mu), np.array(last.g)
            else:
                z = side.states(u)[0][-1].real
                mu, R = z[4:], rotation(z[:4])
            off = [(mu - np.array(wanted.mu)) / 10.0, (R - np.array(wanted.g)).ravel()]
            found.append(np.linalg.norm(np.concatenate(off)))
        print(f"{name:26} {' '.join(f'{x:9.1e}' for x in found)}", flush=True)


def compared(problem: Problem, name: str, made: Any, counts: Any, more: int) -> None:
    """The rows of one side; each first guess is what fewer nodes have found."""
    u = 0.1 * np.ones((1, problem.m))
    for nodes in counts:
        at = np.linspace(0.0, 1.0, nodes + more) if more else (np.arange(nodes) + 0.5) / nodes
        u = u[(at * (len(u) - 1e-9)).astype(int)]
        begun = time.process_time()
        cost, u, good = cheapest(made(problem, nodes), u)
        spent = time.process_time() - begun
        miss, V = Ours(problem, nodes, lm.LieVerlet()).replayed(u)
        true = 0.5 * problem.T / nodes * float((u * (weights(len(u), nodes) @ u)).sum()) + V
        words = "" if good else "  not converged"
        print(f"{name:10} {nodes:5} {cost:9.5f} {true:11.5f} {miss:10.1e} {spent:5.1f}{words}", flush=True)


if __name__ == "__main__":
    main()
