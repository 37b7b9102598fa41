"""Mechanisms of the literature of benchmarks, built of our joints, each with a solution that knows
nothing of them: published numbers, or an equation of motion in minimal coordinates by DOP853.

Source: Gonzalez, Dopico, Lugris and Cuadrado, A benchmarking system for MBS simulation software,
Multibody Syst. Dyn. 16 (2006); the library of computational benchmark problems of IFToMM.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.joints import (
    BallJoint,
    Damper,
    JointPotential,
    Link,
    Linkage,
    Motor,
    PrismaticJoint,
    RevoluteJoint,
    RigidRod,
    Spring,
    UniversalJoint,
)
from liemech.models.swinging import andrews
from liemech.rooms.published import four_bars as published
from liemech.rooms.published.andrews import ANGLES

lib: Any = lm
G = 9.81
X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Mechanism:
    """A linkage with its start, and where it must be.

    joints : that are compared.  end : the time in s, and steps that do for orders.  wanted :
    coordinates of these joints at the end.  source : of the numbers.
    """

    linkage: Linkage
    start: Any
    joints: tuple[str, ...]
    end: float
    steps: int
    wanted: np.ndarray
    source: str

    def error(self, method: Any, steps: int, **options: Any) -> float:
        """The largest, at the end."""
        run = lm.integrate(
            self.linkage,
            method,
            self.start,
            h=self.end / steps,
            steps=steps,
            every=max(1, steps // 500),  # angles go on over whole turns from sample to sample
            progress=False,
            **options,
        )
        found = np.array([run.joint(name).angle[-1] for name in self.joints])
        return float(np.abs(found - self.wanted).max())


def turn(angle: float, axis: int = 2) -> Any:
    """The rotation about a coordinate axis; the angle may be complex, for derivatives."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.eye(3, dtype=np.result_type(c, float))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def posed(parts: list[tuple[Any, Any]]) -> np.ndarray:
    """Poses, (N, 4, 4), of rotations and places."""
    poses = np.tile(np.eye(4), (len(parts), 1, 1))
    for pose, (R, p) in zip(poses, parts):
        pose[:3, :3], pose[:3, 3] = R, p
    return poses


def one_freedom(
    placed: Callable[[Any], list[tuple[Any, Any]]],
    bodies: list[tuple[float, Any]],
    start: tuple[float, float],
    end: float,
    energy: Callable[[Any], Any],
    inside: tuple[float, float] | None = None,
) -> np.ndarray:
    """(q, q') at the end, of M(q) q'' = -M'(q) q'^2/2 - V'(q), M by complex steps from where the bodies are at q, M' by
    differences of order 8; or M and V by Chebyshev polynomials `inside` these angles, where they are dear.
    """
    tiny = 1e-30

    def mass(q: float) -> float:
        total = 0.0
        for (R, p), (m, J) in zip(placed(q + 1j * tiny), bodies):
            dR, dp = R.imag / tiny, p.imag / tiny
            spin = R.real.T @ dR
            w = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            total += m * (dp @ dp) + w @ np.array(J) @ w
        return total

    if inside is not None:
        low, high = inside
        nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.pi * (np.arange(48) + 0.5) / 48)
        nodes = np.array(sorted(nodes, key=lambda x: abs(x - start[0])))
        M, V = (Chebyshev.fit(nodes, [f(x) for x in nodes], 47, domain=inside)
                for f in (mass, lambda q: np.real(energy(q))))  # fmt: skip
        dM, dV = M.deriv(), V.deriv()
        found = solve_ivp(
            lambda t, y: [y[1], -(0.5 * dM(y[0]) * y[1] ** 2 + dV(y[0])) / M(y[0])],
            (0.0, end), start, method="DOP853", rtol=1e-12, atol=1e-13,
        )  # fmt: skip
        assert low < found.y[0].min() and found.y[0].max() < high, found.y[0]
        assert max(abs(M.coef[-4:]).max() / abs(M.coef[0]), abs(V.coef[-4:]).max()) < 1e-10, M.coef[-4:]
        return np.asarray(found.y[:, -1])
    weights = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])

    def rhs(t: float, y: np.ndarray) -> list[float]:
        q, v = y
        h = 2e-3
        sides = [mass(q + k * h) - mass(q - k * h) for k in range(1, 5)]
        slope, pull = weights @ sides / h, energy(q + 1j * tiny).imag / tiny
        return [v, (-0.5 * slope * v * v - pull) / mass(q)]

    found = solve_ivp(rhs, (0.0, end), start, method="DOP853", rtol=1e-12, atol=1e-13)
    return np.asarray(found.y[:, -1])


# ------------------------------------------------------------------ Andrews


@lib.record
class AndrewsSpring(JointPotential):
    """The spring between C and a point of the body that turns about B."""

    def energy(self, q: float) -> float:
        a = andrews
        c, s = lm.formulas.cos(q), lm.formulas.sin(q)
        x, y = a.SD * c + a.SC * s + a.XB - a.XC, a.SD * s - a.SC * c + a.YB - a.YC
        stretch = lm.formulas.sqrt(x * x + y * y) - 0.07785
        return 0.5 * 4530.0 * stretch * stretch


def squeezer(end: float = 0.03) -> Mechanism:
    """Andrews' squeezing mechanism: seven bodies, ten hinges, of whose 50 conditions 41 count."""
    a = andrews
    beta, theta, gamma, phi, delta, omega, epsilon = lm.models.AndrewsMechanism().from_rest().q
    at = {name: np.array([x, y, 0.0]) for name, x, y in (("A", a.XA, a.YA), ("B", a.XB, a.YB))}
    E = turn(beta) @ [a.RR, 0, 0] - turn(beta + theta) @ [a.D, 0, 0]
    five, seven = turn(delta), turn(epsilon)
    parts = [
        (turn(beta), turn(beta) @ [a.RA, 0, 0]),
        (turn(beta + theta), turn(beta) @ [a.RR, 0, 0] - turn(beta + theta) @ [a.DA, 0, 0]),
        (turn(gamma), at["B"] + turn(gamma) @ [a.SB, -a.SA, 0]),
        (turn(phi + delta), E + turn(phi + delta) @ [0, a.EA, 0]),
        (five, at["A"] + five @ [-a.TB, a.TA, 0]),
        (turn(omega + epsilon), E - turn(omega + epsilon) @ [a.FA, 0, 0]),
        (seven, at["A"] + seven @ [a.UB, -a.UA, 0]),
    ]
    masses = [a.M1, a.M2, a.M3, a.M4, a.M5, a.M6, a.M7]
    moments = [a.I1, a.I2, a.I3, a.I4, a.I5, a.I6, a.I7]
    links = [Link(m, [I, I, I]) for m, I in zip(masses, moments)]

    def hinge(first: int, second: int | None, point: Any, name: str) -> Any:
        ends = [p if b is None else parts[b][0].T @ (point - parts[b][1])
                for b, p in ((first, point), (second, point))]  # fmt: skip
        return RevoluteJoint(first, second, *ends, Z, Z, name=name)

    joints = [
        hinge(0, None, np.zeros(3), "beta"),
        hinge(1, 0, parts[0][0] @ [a.RR, 0, 0], "Theta"),
        hinge(2, None, at["B"], "gamma"),
        hinge(4, None, at["A"], "delta"),
        hinge(6, None, at["A"], "epsilon"),
        hinge(3, 4, at["A"] + five @ [a.ZT, 0, 0], "Phi"),
        hinge(5, 6, at["A"] + seven @ [0, -a.U, 0], "Omega"),
        *[hinge(1, other, E, f"E{other}") for other in (2, 3, 5)],
    ]
    loose = Linkage(links, joints, 0.0, [Motor("beta", 0.033), AndrewsSpring("gamma")])
    linkage = loose.independent(posed(parts))
    return Mechanism(
        linkage, linkage.assembled(posed(parts)), tuple(ANGLES), end, 3000, np.array([*ANGLES.values()]),
        "Mazzia and Magherini, Test Set for IVP Solvers (2008), II-10",
    )  # fmt: skip


# ------------------------------------------------------------------ slider-cranks


def slider_crank(end: float = 1.0) -> Mechanism:
    """A crank of 0.2 m, a rod of 0.5 m and a slider in one plane, all hinges."""
    r, L, masses = 0.2, 0.5, (1.0, 2.0, 1.5)
    links = [Link.rod(masses[0], r, 0.02), Link.rod(masses[1], L, 0.02), Link(masses[2], [0.01] * 3)]
    start = 0.4, 12.0
    along = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # e3 of rods to e1

    def placed(q: Any) -> list[tuple[Any, Any]]:
        """The crank turned by q about y, from x to -z."""
        pin = r * np.array([np.cos(q), 0.0, -np.sin(q)])
        tilt = -np.arcsin(r * np.sin(q) / L)
        end = pin + L * np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
        return [(turn(q, 1) @ along, 0.5 * pin), (turn(tilt, 1) @ along, 0.5 * (pin + end)), (np.eye(3), end)]

    parts = posed(placed(start[0]))
    low, high = np.array([0, 0, -0.5 * r]), np.array([0, 0, 0.5 * r])
    joints = [
        RevoluteJoint(0, None, low, [0, 0, 0], Y, Y, name="crank"),
        RevoluteJoint(1, 0, [0, 0, -0.5 * L], high, Y, Y, name="pin"),
        RevoluteJoint(2, 1, [0, 0, 0], [0, 0, 0.5 * L], Y, Y, name="wrist"),
        PrismaticJoint(2, None, axis=X, name="slider"),
    ]
    linkage = Linkage(links, joints, G).independent(parts)
    bodies = [(m, np.diag(link.inertia)) for m, link in zip(masses, links)]
    height = lambda q: sum(m * p[2] for (_, p), m in zip(placed(q), masses))  # noqa: E731
    q, _ = one_freedom(placed, bodies, start, end, lambda q: G * height(q))
    state = linkage.state(angles={"slider": placed(start[0])[2][1][0]}, rates={"crank": start[1]}, near=parts)
    return Mechanism(
        linkage, state, ("slider",), end, 1000, np.array([placed(q)[2][1][0]]),
        "minimal coordinate, DOP853 to 1e-12",
    )  # fmt: skip


def spatial_slider_crank(end: float = 1.0) -> Mechanism:
    """The crank turns in a plane across the slider's way: hinge, ball, Cardan joint, slider.

    Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 10.2;
    Masoudi, Uchida, Dopico and McPhee in the IFToMM library, "spatial rigid slider-crank".
    """
    r, L, pivot = 0.08, 0.3, np.array([0.0, 0.1, 0.12])
    masses = 0.12, 0.5, 2.0
    moments = [1e-4, 1e-4, 1e-5], [4e-3, 4e-3, 4e-4], [1e-4, 1e-4, 1e-4]
    start = 0.0, 6.0

    def placed(q: Any) -> list[tuple[Any, Any]]:
        """The crank upright at q = 0, e3 along it; e3 of the rod from the slider to the crank."""
        pin = pivot + r * np.array([0.0, -np.sin(q), np.cos(q)])
        shift = np.sqrt(L * L - pin[1] ** 2 - pin[2] ** 2)
        slider = np.array([shift, 0.0 * q, 0.0 * q])
        d = (pin - slider) / L
        u = np.cross(d, Z)  # the arm of the cross that the rod carries, across the slider's
        u = u / np.sqrt(u @ u)
        rod = np.transpose([u, np.cross(d, u), d])
        return [(turn(q, 0), pivot + 0.5 * (pin - pivot)), (rod, 0.5 * (pin + slider)), (np.eye(3), slider)]

    parts = posed(placed(start[0]))
    joints = [
        RevoluteJoint(0, None, [0, 0, -0.5 * r], pivot, X, X, name="crank"),
        BallJoint(1, 0, [0, 0, 0.5 * L], [0, 0, 0.5 * r], name="ball"),
        UniversalJoint(1, 2, [0, 0, -0.5 * L], [0, 0, 0], X, Z, name="cross"),
        PrismaticJoint(2, None, axis=X, name="slider"),
    ]
    linkage = Linkage([Link(m, J) for m, J in zip(masses, moments)], joints, G)
    bodies = [(m, np.diag(J)) for m, J in zip(masses, moments)]
    height = lambda q: sum(m * p[2] for (_, p), m in zip(placed(q), masses))  # noqa: E731
    q, _ = one_freedom(placed, bodies, start, end, lambda q: G * height(q))
    state = linkage.state(angles={"crank": 0.0}, rates={"crank": start[1]}, near=parts)
    return Mechanism(
        linkage, state, ("slider",), end, 1000, np.array([placed(q)[2][1][0]]),
        "minimal coordinate, DOP853 to 1e-12",
    )  # fmt: skip


# ------------------------------------------------------------------ Bricard

BRICARD = (-0.02, 0.42)
"""The angle of the first hinge turns back at pi/6, where the others go on."""


def bricard(end: float = 0.4) -> Mechanism:
    """Five rods of 1 m and 1 kg along edges of a cube, six hinges: no freedom by counting, one in
    fact, everywhere; gravity along -y.

    Source: Gonzalez et al. (2006), problem A05.
    """
    edges = [X, Y, Z, -X, -Y, -Z]  # the last is the ground
    corners = np.concatenate([np.zeros((1, 3)), np.cumsum(edges, axis=0)])
    axes = [np.cross(edges[k - 1], edges[k]) for k in range(6)]  # at the beginning of each edge
    # e3 along the rod, frames as the rods lie
    frames = [np.transpose([np.cross(axes[k], edges[k]), axes[k], edges[k]]) for k in range(6)]
    upright = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # y becomes the vertical
    half = np.array([0, 0, 0.5])
    joints: list[Any] = []
    for k in range(6):
        first, second = (k, k - 1) if k < 5 else (4, None)
        point = corners[k]
        ends: list[Any] = [-half if k < 5 else half, half]
        directions = [frames[b].T @ axes[k] if b >= 0 else axes[k] for b in (min(k, 4), k - 1)]
        if k == 0:
            second, ends[1], directions[1] = None, upright @ point, upright @ axes[0]
        if k == 5:
            ends[1], directions[1] = upright @ point, upright @ axes[5]
        joints.append(RevoluteJoint(first, second, *ends, *directions, name=f"hinge {k + 1}"))
    parts = posed([(upright @ frames[k], upright @ (corners[k] + 0.5 * edges[k])) for k in range(5)])
    rod = Link.rod(1.0, 1.0, 0.05)
    linkage = Linkage([rod] * 5, joints, G)

    # the loop by itself: turns about the axes of the edges as they lie, one after another
    def chained(q: Any) -> tuple[list[Any], Any]:
        R, p, found = np.eye(3), np.zeros(3), []
        for k in range(6):
            R = R @ about(axes[k], q[k])
            found.append((upright @ R @ frames[k], upright @ (p + 0.5 * R @ edges[k])))
            p = p + R @ edges[k]
        return found, np.concatenate([(R - np.eye(3)).ravel(), p])

    near = {0.0: np.zeros(6)}

    def closed(q0: Any) -> Any:
        """All angles at the first one, from the nearest that are known; complex steps go along."""
        known = min(near, key=lambda x: abs(x - np.real(q0)))
        q = near[known] + (np.real(q0) - known) * np.eye(6)[0]
        for _ in range(20):
            off = chained(q)[1]
            slopes = np.transpose([chained(q + 1e-30j * e)[1].imag / 1e-30 for e in np.eye(6)])
            step = np.linalg.lstsq(slopes[:, 1:], off, rcond=1e-9)[0]
            q = q - np.concatenate([[0.0], step])
            if np.abs(step).max() < 1e-15:
                break
        assert np.abs(off).max() < 1e-13, (q0, off)
        near[float(np.real(q0))] = q
        along = np.linalg.lstsq(slopes[:, 1:], -slopes[:, 0], rcond=1e-9)[0]
        return q + 1j * np.imag(q0) * np.array([1.0, *along])

    def placed(q0: Any) -> list[tuple[Any, Any]]:
        return chained(closed(q0))[0][:5]

    height = lambda q: sum(p[2] for _, p in placed(q))  # noqa: E731
    q, _ = one_freedom(placed, [(1.0, np.diag(rod.inertia))] * 5, (0.0, 0.0), end, lambda q: G * height(q), BRICARD)
    start = linkage.independent(parts)
    state = start.assembled(parts)
    zero = np.array(start.motion_at(None, 0).at.angles(0.0, state.g))[0]
    return Mechanism(
        start, state, ("hinge 1",), end, 1000, np.array([zero + q]),
        "minimal coordinate, DOP853 to 1e-12",
    )  # fmt: skip


def about(axis: Any, angle: Any) -> Any:
    """The rotation about a unit axis by an angle that may be complex."""
    K = np.cross(np.eye(3), np.asarray(axis))
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


# ------------------------------------------------------------------ a governor


def governor(end: float = 2.0) -> Mechanism:
    """Watt's: a spindle turns freely, two arms with balls swing on it, two rods carry a collar on a spring and a
    damper; two freedoms.

    Source: Gonzalez et al. (2006), problem A06 (a flyball governor, with rods in the place of its stiff springs).
    """
    a, b, m, collar, k, c = 0.4, 0.3, 1.0, 2.0, 400.0, 2.0
    arm = np.array([0.03, 0.03, 0.002])
    spindle, ring = 0.05, np.array([0.02, 0.02, 0.03])
    rod = 0.25
    start, spin = 0.5, 14.0  # the angle of the arms from the spindle, rad, and its speed, rad/s
    links = [Link(1.0, [0.05, 0.05, spindle]), Link(m, arm), Link(m, arm), Link(collar, ring)]

    def low(q: Any) -> Any:
        """The collar below the pivot."""
        return b * np.cos(q) + np.sqrt(rod**2 - (b * np.sin(q)) ** 2)

    rest = -low(start)
    joints = [
        RevoluteJoint(0, None, name="spindle"),
        RevoluteJoint(1, 0, [0, 0, a], [0, 0, 0], Y, Y, name="arm"),
        RevoluteJoint(2, 0, [0, 0, a], [0, 0, 0], Y, Y, name="other arm"),
        PrismaticJoint(3, 0, axis=Z, name="collar"),
        RigidRod(1, 3, [0, 0, a - b], [0, 0, 0], rod, name="rod"),
        RigidRod(2, 3, [0, 0, a - b], [0, 0, 0], rod, name="other rod"),
    ]
    forces = [Spring("collar", k, rest), Damper("collar", c)]
    linkage = Linkage(links, joints, G, forces)
    poses = posed([
        (np.eye(3), np.zeros(3)),
        *[(turn(q, 1), turn(q, 1) @ [0, 0, -a]) for q in (-start, start)],
        (np.eye(3), [0, 0, rest]),
    ])  # fmt: skip
    linkage = linkage.independent(poses)

    def inertia(q: Any) -> Any:
        """About the spindle."""
        swing = 2.0 * ((m * a * a + arm[0]) * np.sin(q) ** 2 + arm[2] * np.cos(q) ** 2)
        return spindle + ring[2] + swing

    tiny = 1e-30
    L = inertia(start) * spin

    def slope(f: Any, q: float) -> float:
        return float(f(q + 1j * tiny).imag / tiny)

    def rhs(t: float, y: np.ndarray) -> list[float]:
        q, v, _ = y
        s = slope(low, q)  # z' = -s v
        h = 1e-4
        bend = sum(w * (slope(low, q + n * h) - slope(low, q - n * h)) / h
                   for n, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)))  # fmt: skip
        mass = 2.0 * (m * a * a + arm[1]) + collar * s * s
        force = 0.5 * L * L / inertia(q) ** 2 * slope(inertia, q)
        force += -2.0 * m * G * a * np.sin(q) + collar * G * s
        force += -k * (low(q) + rest) * s - c * s * s * v - collar * s * bend * v * v
        return [v, force / mass, L / inertia(q)]

    y = solve_ivp(rhs, (0, end), [start, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    angles = {"spindle": 0.0, "arm": -start, "other arm": start, "collar": rest}
    state = linkage.state(angles=angles, rates={"spindle": spin, "arm": 0.0}, near=poses)
    return Mechanism(
        linkage, state, ("spindle", "other arm", "collar"), end, 1000,
        np.array([y[2], y[0], -low(y[0])]), "two minimal coordinates, DOP853 to 1e-12",
    )  # fmt: skip


# ------------------------------------------------------------------ N four-bars


def four_bars(loops: int, end: float = 0.4) -> Mechanism:
    """N four-bars that fall from upright with 1 m/s, until before their dead point."""
    linkage, upright = published.four_bars(loops)
    turning, weight = (loops + 1) / 3.0 + loops, G * (0.5 * (loops + 1) + loops)
    y = solve_ivp(
        lambda t, y: [y[1], weight / turning * np.sin(y[0])], (0, end), [0.0, 1.0],
        method="DOP853", rtol=1e-13, atol=1e-14,
    ).y[:, -1]  # fmt: skip
    return Mechanism(
        linkage, upright, ("crank 0", f"crank {loops}"), end, 500, np.array([y[0], y[0]]),
        "a pendulum, DOP853 to 1e-13",
    )  # fmt: skip


ALL: dict[str, Callable[[], Mechanism]] = {
    "Andrews": squeezer,
    "slider-crank": slider_crank,
    "spatial slider-crank": spatial_slider_crank,
    "Bricard": bricard,
    "governor": governor,
    "8 four-bars": lambda: four_bars(8),
}
