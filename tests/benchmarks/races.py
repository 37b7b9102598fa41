"""The problems of the leader board: equations in plain numbers for other packages, ten outputs, and
references from elsewhere.

    python tests/benchmarks/races.py        # computes tests/reference/races.json anew, with heyoka in 113 bits

Every problem is written once as y' = f(t, y) of single numbers, which every package for smooth
equations reads: heyoka makes series of it, SciPy calls it, Numba and JAX compile it.  Outputs are
what is compared: momenta, rotation matrices, positions.
"""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

REFERENCE = Path(__file__).parents[1] / "reference" / "races.json"
Numbers = Sequence[Any]
Rates = Callable[[Any, Any, Numbers], list[Any]]  # of a module with sin and cos, the time, and the numbers


@dataclass(frozen=True, eq=False)
class Race:
    """A problem: equations, start, the end of time, and what is compared.

    rates : y' = f(m, t, y), m a module with sin and cos.  start : y(0).  end : the last of the
    `count` equally spaced outputs.
    outputs : of many states, (n, len(y)), what is compared, (n, k); all of y unless it says
    otherwise.
    """

    key: str
    name: str
    rates: Rates
    start: tuple[float, ...]
    end: float
    outputs: Callable[[np.ndarray], np.ndarray] = np.asarray
    count: int = 10

    @property
    def times(self) -> np.ndarray:
        """Of the outputs."""
        return self.end * np.arange(1, self.count + 1) / self.count

    @property
    def exact(self) -> np.ndarray:
        """The outputs by heyoka in 113 bits (64 bits for t = 10^5)."""
        return self.outputs(np.array(json.loads(REFERENCE.read_text(encoding="utf-8"))[self.key], dtype=float))


# ------------------------------------------------------------------ rigid bodies

MU = (0.5, 0.0, math.sqrt(0.75))
MOMENTS = (1.0, 1.5, 2.0)
ONE = (1.0, 0.0, 0.0, 0.0)


def turning(q: Numbers, w: Numbers) -> list[Any]:
    """q' = q w/2 of a unit quaternion, scalar part first, and a velocity in the body."""
    return [
        -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
        0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
        0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
        0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
    ]


def cross(a: Numbers, b: Numbers) -> list[Any]:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices, (n, 9), of unit quaternions, (n, 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z,
        ],
        axis=-1,
    )  # fmt: skip


def body(m: Any, t: Any, y: Numbers) -> list[Any]:
    """mu' = mu x J^-1 mu."""
    return [
        (1 / 2.0 - 1 / 1.5) * (y[1] * y[2]),
        (1 / 1.0 - 1 / 2.0) * (y[2] * y[0]),
        (1 / 1.5 - 1 / 1.0) * (y[0] * y[1]),
    ]


def body_attitude(m: Any, t: Any, y: Numbers) -> list[Any]:
    """And the attitude as a quaternion."""
    return [*body(m, t, y), *turning(y[3:7], [y[0], y[1] * (1 / 1.5), y[2] * 0.5])]


def momentum_and_attitude(y: np.ndarray) -> np.ndarray:
    """mu and the rotation matrix."""
    return np.concatenate([y[:, :3], matrices(y[:, 3:7])], axis=1)


TOP: Any = json.loads((REFERENCE.parent / "heavy_top.json").read_text())
FISH: Any = json.loads((REFERENCE.parent / "kirchhoff_se3.json").read_text())


def numbers(data: Any, name: str) -> np.ndarray:
    """An entry of a reference."""
    return np.array(data[name], dtype=float)


def quaternion(g: np.ndarray) -> tuple[float, ...]:
    """Of a rotation matrix that is not near a half turn, scalar part first."""
    w = 0.5 * math.sqrt(1.0 + np.trace(g))
    x, y, z = (np.array([g[2, 1] - g[1, 2], g[0, 2] - g[2, 0], g[1, 0] - g[0, 1]]) / (4.0 * w)).tolist()
    return w, x, y, z


TOP_MOMENTS, TOP_LOAD = (tuple(numbers(TOP, "J").tolist()), tuple((numbers(TOP, "mgl") * numbers(TOP, "chi")).tolist()))


def top(m: Any, t: Any, y: Numbers) -> list[Any]:
    """mu' = mu x w + Gamma x load, Gamma = g^T e_3."""
    (a, b, c), (w, i, j, k) = TOP_MOMENTS, y[3:7]
    rate = [y[0] * (1 / a), y[1] * (1 / b), y[2] * (1 / c)]
    down = [2.0 * (i * k - w * j), 2.0 * (j * k + w * i), w * w - i * i - j * j + k * k]
    turn, pull = cross(y[:3], rate), cross(down, TOP_LOAD)
    return [turn[0] + pull[0], turn[1] + pull[1], turn[2] + pull[2], *turning(y[3:7], rate)]


BLOCKS = tuple(tuple(tuple(row) for row in numbers(FISH, name).tolist()) for name in "ADM")


def fish(m: Any, t: Any, y: Numbers) -> list[Any]:
    """Kirchhoff's body: Pi' = Pi x w + P x v, P' = P x w, and where it is."""
    A, D, M = BLOCKS
    Pi, P, q = y[:3], y[3:6], y[6:10]
    w = [
        A[i][0] * Pi[0] + A[i][1] * Pi[1] + A[i][2] * Pi[2] + D[i][0] * P[0] + D[i][1] * P[1] + D[i][2] * P[2]
        for i in range(3)
    ]
    v = [
        D[0][i] * Pi[0] + D[1][i] * Pi[1] + D[2][i] * Pi[2] + M[i][0] * P[0] + M[i][1] * P[1] + M[i][2] * P[2]
        for i in range(3)
    ]
    turn, push, force = cross(Pi, w), cross(P, v), cross(P, w)
    s = q[1:4]  # R v = v + 2 q_0 s x v + 2 s x (s x v)
    once = cross(s, v)
    twice = cross(s, once)
    moved = [v[i] + 2.0 * (q[0] * once[i] + twice[i]) for i in range(3)]
    return [turn[0] + push[0], turn[1] + push[1], turn[2] + push[2], *force, *turning(q, w), *moved]


def impulse_and_pose(y: np.ndarray) -> np.ndarray:
    """Pi, P, the rotation matrix, the place."""
    return np.concatenate([y[:, :6], matrices(y[:, 6:10]), y[:, 10:13]], axis=1)


FOUR = (1.0, 1.3, 1.7, 2.1, 2.4, 3.0)
"""Inertia of the body that turns in four dimensions: of the planes 12, 13, 14, 23, 24, 34."""
PLANES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
FOUR_MU = (0.5, -0.3, 0.4, 0.7, 0.2, -0.6)


def skew(m: Numbers, i: int, j: int) -> Any:
    """The entry (i, j), i unlike j, of the skew matrix with the numbers m below the diagonal."""
    return -m[PLANES.index((i, j))] if i < j else m[PLANES.index((j, i))]


def four(m: Any, t: Any, y: Numbers) -> list[Any]:
    """M' = [M, W], g' = g W on SO(4), W_ji = -W_ij = mu_ij/I_ij for i < j."""
    M, every = y[:6], range(4)
    W = [M[n] * (1.0 / FOUR[n]) for n in range(6)]
    turn = [
        [skew(M, j, k) * skew(W, k, i) - skew(W, j, k) * skew(M, k, i) for k in every if k not in (i, j)]
        for i, j in PLANES
    ]
    move = [[y[6 + 4 * i + k] * skew(W, k, j) for k in every if k != j] for i in every for j in every]
    return [sum(terms[1:], terms[0]) for terms in [*turn, *move]]


def driven(m: Any, t: Any, y: Numbers) -> list[Any]:
    """g' = g xi(t) with xi = (cos 2t, sin t, 1 + cos(3t)/2)."""
    return turning(y, [m.cos(2.0 * t), m.sin(t), 1.0 + 0.5 * m.cos(3.0 * t)])


# ------------------------------------------------------------------ points


def kepler(m: Any, t: Any, y: Numbers) -> list[Any]:
    """q'' = -q/|q|^3 in the plane."""
    pull = (y[0] * y[0] + y[1] * y[1]) ** -1.5
    return [y[2], y[3], -y[0] * pull, -y[1] * pull]


def pendulum(m: Any, t: Any, y: Numbers) -> list[Any]:
    """q'' = -g e_3 - (|v|^2 - g q_3) q on the unit sphere."""
    x, v = y[:3], y[3:6]
    pull = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 9.81 * x[2]
    return [*v, -(pull * x[0]), -(pull * x[1]), -(pull * x[2]) - 9.81]


SUNS = (1.00000597682, 0.000954786104043, 0.000285583733151, 0.0000437273164546, 0.0000517759138449, 1 / 1.3e8)
PULL = 2.95912208286e-4
PLACES = (
    (0.0, 0.0, 0.0), (-3.5023653, -3.8169847, -1.5507963), (9.0755314, -3.0458353, -1.6483708),
    (8.3101420, -16.2901086, -7.2521278), (11.4707666, -25.7294829, -10.8169456), (-15.5387357, -25.2225594, -3.1902382),
)  # fmt: skip
SPEEDS = (
    (0.0, 0.0, 0.0), (0.00565429, -0.00412490, -0.00190589), (0.00168318, 0.00483525, 0.00192462),
    (0.00354178, 0.00137102, 0.00055029), (0.00288930, 0.00114527, 0.00039677), (0.00276725, -0.00170702, -0.00136504),
)  # fmt: skip
"""Sun, Jupiter, Saturn, Uranus, Neptune, Pluto: Hairer, Lubich, Wanner, I.2.4, table 2.2; AU and days."""


def barycentric(rows: Any) -> list[float]:
    """Seen from the centre of mass."""
    x, masses = np.array(rows), np.array(SUNS)
    return list((x - masses @ x / masses.sum()).ravel().tolist())


def planets(m: Any, t: Any, y: Numbers) -> list[Any]:
    """Newton's law for six bodies."""
    zero = 0.0 * y[0]
    pull = [zero] * 18
    for i in range(6):
        for j in range(i):
            d = [y[3 * j + k] - y[3 * i + k] for k in range(3)]
            size = PULL * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) ** -1.5
            for k in range(3):
                part = size * d[k]
                pull[3 * i + k] = pull[3 * i + k] + SUNS[j] * part
                pull[3 * j + k] = pull[3 * j + k] - SUNS[i] * part
    return [*y[18:36], *pull]


FISH_START = (
    *numbers(FISH, "Pi0").tolist(), *numbers(FISH, "P0").tolist(), *quaternion(numbers(FISH, "R0")), *numbers(FISH, "x0").tolist(),
)  # fmt: skip
TOP_START = (*numbers(TOP, "pi0").tolist(), *quaternion(numbers(TOP, "R0")))

RACES = (
    Race("momentum", "free body, momentum, t = 100", body, MU, 100.0),
    Race("attitude", "free body, momentum and attitude, t = 100", body_attitude, (*MU, *ONE), 100.0, momentum_and_attitude),
    Race("long", "free body, momentum and attitude, t = 10^5", body_attitude, (*MU, *ONE), 1e5, momentum_and_attitude),
    Race("top", "heavy top, t = 10", top, TOP_START, 10.0, momentum_and_attitude),
    Race("fish", "Kirchhoff's body, impulse and pose, t = 20", fish, FISH_START, 20.0, impulse_and_pose),
    Race("kepler", "Kepler, e = 0.9, t = 60", kepler, (0.1, 0.0, 0.0, math.sqrt(19.0)), 60.0),
    Race("pendulum", "spherical pendulum, t = 20", pendulum, (0.6, 0.0, -0.8, 0.4, 1.5, 0.3), 20.0),
    Race(
        "planets", "outer Solar System, places, 100 years", planets, (*barycentric(PLACES), *barycentric(SPEEDS)), 36525.0,
        lambda y: np.asarray(y)[:, :18],
    ),
    Race("four", "free body on SO(4), momentum and attitude, t = 50", four, (*FOUR_MU, *np.eye(4).ravel().tolist()), 50.0),
    Race("driven", "driven rotation, g' = g xi(t), t = 50", driven, ONE, 50.0, matrices),
)  # fmt: skip


# ------------------------------------------------------------------ references


def reference(race: Race) -> list[list[str]]:
    """The states at the outputs, by heyoka in 113 bits, 1e-30 a step; in 64 bits where that would take hours."""
    hy: Any = importlib.import_module("heyoka")
    names = [f"y{i}" for i in range(len(race.start))]
    variables = hy.make_vars(*names)
    rates = race.rates(hy, hy.time, variables)
    kind = np.longdouble if race.end > 1e4 else hy.real

    def number(x: float) -> Any:
        return np.longdouble(x) if race.end > 1e4 else hy.real(x, 113)

    start = [number(x) for x in race.start]
    tolerance = number(1e-20 if race.end > 1e4 else 1e-30)
    integrator = hy.taylor_adaptive(
        list(zip(variables, rates, strict=True)), start, tol=tolerance, fp_type=kind, compact_mode=True
    )
    found = []
    for t in race.times.tolist():
        integrator.propagate_until(number(t))
        found.append([f"{x!s}" for x in integrator.state])
    return found


def main() -> None:
    """Write the references."""
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    for race in RACES:
        if race.key not in kept:
            kept[race.key] = [[text[:28] if "e" not in text else text for text in row] for row in reference(race)]
            print(race.name, flush=True)
            REFERENCE.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
