"""Makes rigid_body_steps.json: the methods themselves in 45-digit arithmetic, from their definitions.

python tests/benchmarks/rigid_body_steps.py
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath as mp

mp.mp.dps = 45
H = 0.5
LOAD = "0.18", "0", "0.24"  # weight times centre of the top
J = [mp.mpf(2) / 3, mp.mpf(1), mp.mpf(2)]
START = [mp.mpf("0.5"), mp.mpf(0), mp.sqrt(mp.mpf("0.75"))]
SAMPLES = {"Lie-Verlet, Cayley": (1, 10, 40), "Lie-Verlet, exp": (1, 10, 40)}

Vector = list[Any]
Step = Callable[[Vector, Any, Any], tuple[Vector, Any]]  # momentum, attitude, h


def times(s: Any, a: Vector) -> Vector:
    return [s * x for x in a]


def plus(*vectors: Vector) -> Vector:
    return [mp.fsum(xs) for xs in zip(*vectors, strict=True)]


def dot(a: Vector, b: Vector) -> Any:
    return mp.fsum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def velocity(p: Vector) -> Vector:
    return [x / j for x, j in zip(p, J, strict=True)]


def hat(w: Vector) -> Any:
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exponential(x: Vector) -> Any:
    angle = mp.norm(mp.matrix(x))
    return mp.eye(3) + mp.sin(angle) / angle * hat(x) + (1 - mp.cos(angle)) / angle**2 * hat(x) ** 2


def cayley(x: Vector) -> Any:
    return (mp.eye(3) - hat(x) / 2) ** -1 * (mp.eye(3) + hat(x) / 2)


def at_start(x: Vector, p: Vector, tau: Any) -> Vector:
    """(dtau^-1_x)* p, the momentum at the start of a step tau(x)."""
    if tau is cayley:
        return plus(p, times(mp.mpf(1) / 2, cross(x, p)), times(dot(x, p) / 4, x))
    angle = mp.norm(mp.matrix(x))
    d = (1 - angle / 2 * mp.cot(angle / 2)) / angle**2
    return plus(p, times(mp.mpf(1) / 2, cross(x, p)), times(d, cross(x, cross(x, p))))


def algorithm_1(p: Vector, h: Any) -> Vector:
    return times(h, velocity(p))


def hamilton_jacobi_4(p: Vector, h: Any) -> Vector:
    v = velocity(p)
    a = velocity(cross(p, v))
    return plus(times(h, v), times(h**3 / 12, plus(cross(v, a), velocity(cross(a, p)))))


def implicit(displacement: Callable[[Vector, Any], Vector], tau: Any) -> Step:
    def step(mu: Vector, g: Any, h: Any) -> tuple[Vector, Any]:
        p = mu
        while True:
            off = plus(at_start(displacement(p, h), p, tau), times(-1, mu))
            p = plus(p, times(-1, off))
            if max(map(abs, off)) < 1e-42:
                turn = tau(displacement(p, h))
                return list(turn.T * mp.matrix(mu)), g * turn

    return step


def suzuki(base: Step) -> Step:
    a = 1 / (4 - mp.mpf(4) ** (mp.mpf(1) / 3))

    def step(mu: Vector, g: Any, h: Any) -> tuple[Vector, Any]:
        for share in (a, a, 1 - 4 * a, a, a):
            mu, g = base(mu, g, share * h)
        return mu, g

    return step


def verlet(base: Step) -> Step:
    load = [mp.mpf(x) for x in LOAD]

    def step(mu: Vector, g: Any, h: Any) -> tuple[Vector, Any]:
        mu, g = base(plus(mu, times(h / 2, cross(list(g[2, :]), load))), g, h)
        return plus(mu, times(h / 2, cross(list(g[2, :]), load))), g

    return step


def rkmk4(mu: Vector, g: Any, h: Any) -> tuple[Vector, Any]:
    """mu' = Ad*_exp(x) mu, x' = dexp^-1 of the velocity to second order, by the classical Runge-Kutta method."""

    def slope(x: Vector) -> Vector:
        turn = exponential(x) if any(x) else mp.eye(3)
        k = velocity(list(turn.T * mp.matrix(mu)))
        c = cross(x, k)
        return times(h, plus(k, times(mp.mpf(1) / 2, c), times(mp.mpf(1) / 12, cross(x, c))))

    k1 = slope([mp.mpf(0)] * 3)
    k2 = slope(times(mp.mpf(1) / 2, k1))
    k3 = slope(times(mp.mpf(1) / 2, k2))
    k4 = slope(k3)
    turn = exponential(times(mp.mpf(1) / 6, plus(k1, times(2, plus(k2, k3)), k4)))
    return list(turn.T * mp.matrix(mu)), g * turn


METHODS: dict[str, Step] = {
    "RKMK4": rkmk4,
    "Algorithm 1, exp": implicit(algorithm_1, exponential),
    "Algorithm 1, Cayley": implicit(algorithm_1, cayley),
    "Hamilton-Jacobi 4, exp": implicit(hamilton_jacobi_4, exponential),
    "Suzuki of Algorithm 1, Cayley": suzuki(implicit(algorithm_1, cayley)),
    "Suzuki of Algorithm 1, exp": suzuki(implicit(algorithm_1, exponential)),
    "Lie-Verlet, Cayley": verlet(implicit(algorithm_1, cayley)),
    "Lie-Verlet, exp": verlet(implicit(algorithm_1, exponential)),
}


def run(step: Step, samples: tuple[int, ...]) -> list[dict[str, Any]]:
    mu, g, found = START, mp.eye(3), []
    for n in range(1, samples[-1] + 1):
        mu, g = step(mu, g, mp.mpf(H))
        if n in samples:
            found.append(
                {"n": n, "mu": [float(x) for x in mu], "g": [[float(g[i, j]) for j in range(3)] for i in range(3)]}
            )
    return found


if __name__ == "__main__":
    data = {
        "source": "the methods themselves in 45-digit arithmetic, implicit steps to 1e-42, rounded to double; rigid_body_steps.py",
        "inertia": [float(x) for x in J],
        "load": [float(x) for x in LOAD],
        "mu": [float(x) for x in START],
        "h": H,
        "steps": {name: run(step, SAMPLES.get(name, (1, 10, 200))) for name, step in METHODS.items()},
    }
    rows = re.sub(r"\[[^][{}]*\]", lambda row: " ".join(row[0].split()), json.dumps(data, indent=1))
    Path(__file__).with_suffix(".json").write_text(rows + "\n")
