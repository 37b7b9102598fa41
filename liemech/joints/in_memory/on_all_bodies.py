"""Potentials and loads on all bodies of a linkage by one formula, which has all poses at once.

Source: Marsden and West, Acta Numerica 10 (2001), section 3.2 (forces at both ends of a step).
"""

from __future__ import annotations

from typing import Any

from ...formulas import Vec, cross, derivative, dot, identity_matrix, vec
from .links import pose_in

UNITS = tuple(identity_matrix(6))


def entries_of_all(system: Any, old: Any) -> Vec:
    """The entries of all poses, row by row, (16 N,)."""
    return vec(*[x for b in range(system.on_all.count) for row in pose_in(old.at(b)) for x in row])


def velocities_of_all(system: Any, work: Any) -> Vec:
    """The velocities of all bodies at which loads are looked for, (6 N,)."""
    return vec(*[x for b in range(system.on_all.count) for x in work.load_velocity.at(b)])


def put_parts(system: Any, column: Any, whole: Vec) -> None:
    """The parts of a covector on all bodies, (6 N,), each to its body."""
    for b in range(system.on_all.count):
        column.put(b, whole[6 * b : 6 * b + 6])


def pulled_together(system: Any, old: Any, work: Any) -> None:
    """The force of a potential of all poses; of one that is derived -dV/ds along g exp(s e_i), for each i."""
    acting, g = system.on_all, entries_of_all(system, old)
    if not acting.derived:
        put_parts(system, work.field, acting.potential.force(acting.group, g))
        return
    for i, unit in enumerate(identity_matrix(6 * system.on_all.count)):
        along: list[Any] = []
        for b in range(acting.count):
            w, v = unit[6 * b : 6 * b + 3], unit[6 * b + 3 : 6 * b + 6]
            rows = [g[16 * b + 4 * j : 16 * b + 4 * j + 3] for j in range(3)]
            along = [*along, *[x for R in rows for x in (*cross(R, w), dot(R, v))], *[0.0] * 4]
        slope = derivative(acting.potential.energy, g, vec(*along))
        work.field.nth(i % 6).put(i // 6, -slope)


def pushed_together(system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """The kick h F of a load, and, of each body alone, its derivative by the velocity, column by column."""
    acting, g, xi = system.seen(system.on_all), entries_of_all(system, old), velocities_of_all(system, work)

    def kick(w: Vec) -> Vec:
        return h * acting.load.covector(t, w, g)

    put_parts(system, work.load_kick, kick(xi))
    for i, unit in enumerate(identity_matrix(6 * system.on_all.count)):
        save_slope(work, i, derivative(kick, xi, unit))


def damping_of_all(system: Any, t: float, old: Any, work: Any) -> None:
    """The damping of each body by a load, by columns."""
    acting, g, xi = system.seen(system.on_all), entries_of_all(system, old), velocities_of_all(system, work)
    for i, unit in enumerate(identity_matrix(6 * system.on_all.count)):
        save_slope(work, i, acting.load.resistance(t, xi, g, unit))


def save_slope(work: Any, i: int, column: Vec) -> None:
    """Of column number i of a derivative the part of the body that moves."""
    work.slope_of_all.nth(i % 6).put(i // 6, column[i // 6 * 6 : i // 6 * 6 + 6])
