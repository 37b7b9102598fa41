"""Reference motions of constrained models, 25 digits, in coordinates of their own wherever there
are some.

    python docs/derivations/constrained_models.py > tests/reference/constrained_models.json

Each is the solution of an ordinary differential equation by extrapolation of order 32, with 40
digits:

* a chain of three masses in a plane, in its angles, by Lagrange's equations with
m_ij = m_max(i,j) + ... + m_N:
  sum_j m_ij l_i l_j (cos(x_i - x_j) x_j'' + sin(x_i - x_j) x_j'^2) = -g l_i m_ii sin x_i;
* a chain of two masses in space, in positions, with the tensions that keep rods as long as they
are;
* a bead on the parabola y = a x^2: (1 + 4 a^2 x^2) x'' + 4 a^2 x x'^2 + 2 a g x = 0;
* a geodesic of an ellipsoid, in positions: q'' = -l n, n = (q_i/a_i^2), l = sum
v_i^2/a_i^2 / |n|^2;
* linkages of N parallelograms, by their angle: I x'' = -M g cos x, I = (N + 1)/3 + N,
M = (N + 1)/2 + N.
"""

import json
from collections.abc import Callable

import mpmath as mp

mp.mp.dps = 40
G = mp.mpf("9.81")


def end(rate: Callable[..., list], start: list, t: str, steps: int = 16, columns: int = 16) -> list:
    """The solution at a time: midpoint steps, extrapolated.  Source: Hairer, Norsett, Wanner,
    Solving ODEs I, II.9 (Gragg).
    """
    y, h = [mp.mpf(x) for x in start], mp.mpf(t) / steps
    for _ in range(steps):
        table: list[list] = []
        for j in range(columns):
            parts = 2 * (j + 1)
            small = h / parts
            before, now = y, [a + small * b for a, b in zip(y, rate(0, y), strict=True)]
            for _ in range(parts - 1):
                before, now = (
                    now,
                    [a + 2 * small * b for a, b in zip(before, rate(0, now), strict=True)],
                )
            row = [
                [(a + b + small * c) / 2 for a, b, c in zip(now, before, rate(0, now), strict=True)]
            ]
            for k, upper in enumerate(table[-1] if table else []):
                ratio = (mp.mpf(parts) / (2 * (j - k))) ** 2 - 1
                row.append([a + (a - b) / ratio for a, b in zip(row[-1], upper, strict=True)])
            table.append(row)
        y = table[-1][-1]
    return y


def digits(x: list) -> list[str]:
    """25 of them."""
    return [mp.nstr(entry, 25, strip_zeros=False) for entry in x]


def planar_chain() -> dict[str, object]:
    """Three masses, from angles at rest."""
    m, l, x0 = (
        [mp.mpf(s) for s in ("1", "0.5", "0.7")],
        [mp.mpf(s) for s in ("1", "0.8", "0.6")],
        ["0.9", "0.4", "-0.7"],
    )
    a = [[mp.fsum(m[max(i, j) :]) for j in range(3)] for i in range(3)]

    def rate(t: object, y: list) -> list:
        x, w = y[:3], y[3:]
        left = mp.matrix(3, 3)
        right = mp.matrix(3, 1)
        for i in range(3):
            right[i] = -G * l[i] * a[i][i] * mp.sin(x[i])
            for j in range(3):
                left[i, j] = a[i][j] * l[i] * l[j] * mp.cos(x[i] - x[j])
                right[i] -= a[i][j] * l[i] * l[j] * mp.sin(x[i] - x[j]) * w[j] ** 2
        return [*w, *mp.lu_solve(left, right)]

    x = end(rate, [*map(mp.mpf, x0), 0, 0, 0], "1", steps=64)[:3]
    at, found = [mp.mpf(0), mp.mpf(0)], []
    for angle, length in zip(x, l, strict=True):
        at = [at[0] + length * mp.sin(angle), at[1] - length * mp.cos(angle)]
        found += at
    return {
        "masses": ["1", "0.5", "0.7"],
        "lengths": ["1", "0.8", "0.6"],
        "angles": x0,
        "t": "1",
        "q": digits(found),
    }


def spatial_chain() -> dict[str, object]:
    """Two unit masses on unit rods."""
    q0, v0 = ["0.6", "0", "-0.8", "0.6", "0.8", "-1.4"], ["0", "0.5", "0", "0.3", "0.5", "0"]

    def rate(t: object, y: list) -> list:
        q, r, v, s = y[:3], [b - a for a, b in zip(y[:3], y[3:6], strict=True)], y[6:9], y[9:]
        u = [b - a for a, b in zip(v, s, strict=True)]
        dot = mp.fdot
        # q.q'' = -v.v and r.r'' = -u.u, with q'' = f - x q + y r and (q + r)'' = f - y r
        f = [0, 0, -G]
        left = mp.matrix([[dot(q, q), -dot(q, r)], [-dot(q, r), 2 * dot(r, r)]])
        x, z = mp.lu_solve(left, mp.matrix([dot(v, v) + dot(q, f), dot(u, u)]))
        first = [f[i] - x * q[i] + z * r[i] for i in range(3)]
        return [*v, *s, *first, *[f[i] - z * r[i] for i in range(3)]]

    y = end(rate, [*map(mp.mpf, q0), *map(mp.mpf, v0)], "1")
    return {"q0": q0, "v0": v0, "t": "1", "q": digits(y[:6])}


def bead() -> dict[str, object]:
    """From rest."""
    a = mp.mpf("1.5")

    def rate(t: object, y: list) -> list:
        x, v = y
        return [v, -(4 * a * a * x * v * v + 2 * a * G * x) / (1 + 4 * a * a * x * x)]

    x = end(rate, [mp.mpf("0.5"), 0], "1", steps=64)[0]
    return {"a": "1.5", "x0": "0.5", "t": "1", "q": digits([x, a * x * x])}


def ellipsoid() -> dict[str, object]:
    """Half axes 1, 2, 2: the start is on it exactly."""
    axes, q0, v0 = ["1", "2", "2"], ["0.6", "1.6", "0"], ["0.8", "-1.2", "0.5"]
    squares = [mp.mpf(a) ** 2 for a in ("1", "2", "2")]

    def rate(t: object, y: list) -> list:
        q, v = y[:3], y[3:]
        n = [x / s for x, s in zip(q, squares, strict=True)]
        size = mp.fsum(x * x / s for x, s in zip(v, squares, strict=True)) / mp.fdot(n, n)
        return [*v, *[-size * x for x in n]]

    y = end(rate, [*map(mp.mpf, q0), *map(mp.mpf, v0)], "2")
    return {"axes": axes, "q0": q0, "v0": v0, "t": "2", "q": digits(y[:3])}


def linkage(loops: int) -> dict[str, object]:
    """Cranks upright, their ends moving at 1 m/s to the right."""
    inertia, weight = mp.mpf(loops + 1) / 3 + loops, mp.mpf(loops + 1) / 2 + loops
    x = end(lambda t, y: [y[1], -weight * G / inertia * mp.cos(y[0])], [mp.pi / 2, -1], "0.5")[0]
    return {"loops": loops, "t": "0.5", "q": digits([mp.cos(x), mp.sin(x)])}


if __name__ == "__main__":
    models = {
        "planar chain": planar_chain(),
        "spatial chain": spatial_chain(),
        "bead": bead(),
        "ellipsoid": ellipsoid(),
    }
    print(json.dumps({"gravity": "9.81", **models, "linkages": [linkage(1), linkage(2)]}, indent=1))
