"""The orders of symmetric methods, 2, 4, 6 and 8, measured on rotations, rigid motions, SO(4), a
group given by generators, a top.

`PYTHONPATH=tests:. python tests/integrators/test_symmetric_orders.py --write` puts the table into
docs/proof/measured/orders.md, with `--new` it measures new rows alone; `--print` only shows it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from orders import Problem, Rotating, Smooth, Table
from scenes import kirchhoff_body, pose, rotation

import liemech as lm
from liemech.groups.matrices.matrix_group import MatrixLieGroup
from liemech.tableaus import gauss

EXP, CAYLEY = lm.Exponential(), lm.Cayley()
ALGORITHM_1 = lm.CovariantVariational(EXP), lm.CovariantVariational(CAYLEY)
VERLET = lm.LieVerlet(EXP), lm.LieVerlet(CAYLEY)


# ---------------------------------------------------------------- problems


class Turned(Smooth, Rotating):
    """A smooth problem of which the turning alone is compared."""


@functools.cache
def columns() -> tuple[tuple[Problem, ...], ...]:
    """A free body, a body in a fluid, a body in four dimensions, one on SL(2), a heavy top on SO(3) or on se(3)*."""
    rng = np.random.default_rng(5)
    rotations = np.array([rotation(rng) for _ in range(4)])
    free = lm.RigidBody([1.0, 1.6, 2.3])
    fluid, start, _ = kirchhoff_body()
    poses = np.array([start.g, *(pose(R, x) for R, x in zip(rotations[1:], rng.normal(size=(3, 3))))])
    four = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.4, 1.9, 1.2, 2.3, 1.6]))
    group = MatrixLieGroup.of(lm.SL(2).generators)
    linear = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.6, 2.3]))
    shears = np.array([group.exp(x) for x in 0.5 * rng.normal(size=(4, 3))])
    top = lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
    reduced, started = (
        lm.models.ReducedHeavyTop(top.inertia, top.weight, top.centre),
        top.state(directions(rng, 3), rotations),
    )
    impulses = np.array([start.mu, *np.linalg.norm(start.mu) * directions(rng, 6)[1:]])
    return (
        (Smooth("free body", free, free.state(1.3 * directions(rng, 3), rotations), 10.0),),
        (Smooth("body in a fluid", fluid, fluid.state(impulses, poses), 2.0),),
        (Smooth("SO(4)", four, four.state(1.5 * directions(rng, 6), lm.SO(4).random(rng, 4)), 4.0),),
        (Smooth("SL(2)", linear, linear.state(1.2 * directions(rng, 3), shears), 2.0),),
        (Smooth("heavy top", top, started, 2.0), Turned("heavy top", reduced, reduced.from_top(started), 2.0)),
    )


def directions(rng: np.random.Generator, dim: int) -> np.ndarray:
    """Four unit vectors."""
    v = rng.normal(size=(4, dim))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


# ---------------------------------------------------------------- methods


def rows() -> Iterator[lm.Method]:
    """All symmetric methods that need no field, and Lie-Verlet with what is made of it."""
    yield from ALGORITHM_1
    for p in (4, 6, 8):
        yield from (lm.Composition(base, order=p) for base in ALGORITHM_1)
    yield from (
        lm.LiePoissonHamiltonJacobi(2, EXP),
        lm.LiePoissonHamiltonJacobi(2, CAYLEY),
        lm.LiePoissonHamiltonJacobi(4, EXP),
    )
    yield from VERLET
    for p in (4, 6, 8):
        yield lm.Composition(VERLET[0], order=p)
    yield from (lm.MoserVeselov(), lm.ThreeRotations(), lm.ImplicitMidpoint(), lm.SphericalMidpoint())
    yield from (lm.Isospectral(p) for p in (2, 4, 6, 8))


HEAD = (
    "| symmetric method | order | free body, momentum | attitude | fluid, momentum | pose | SO(4), "
    "momentum | attitude | SL(2), momentum | element | heavy top, momentum | attitude |"
)
ROWS = {method.name: (method, method.order) for method in rows()}
TABLE = Table(HEAD, ROWS, columns)
ALWAYS = {m.name for m in (*ALGORITHM_1, lm.ThreeRotations(), lm.Isospectral(4))}
"""What is measured whenever the tests run, on half of the problems.  In fields test_mechanical has the orders, too."""
CHOICES = [
    *(pytest.param(name, 0, marks=[] if name in ALWAYS else [pytest.mark.slow]) for name in ROWS),
    *(pytest.param(name, 1, marks=pytest.mark.slow) for name in ROWS if name in ALWAYS),
]


def test_the_page_has_the_table() -> None:
    TABLE.is_printed(__file__)


@pytest.mark.slow
@pytest.mark.compiled  # in plain Python each row takes ten seconds and more
@pytest.mark.parametrize(("name", "half"), CHOICES)
def test_order(name: str, half: int) -> None:
    """Within 0.1, on half of the problems, and within 0.05 of what the page has; `--print` measures all."""
    order, slopes = ROWS[name][1], TABLE.measured(name, half)
    found = [p for p in slopes if p is not None and not math.isnan(p)]
    assert found == pytest.approx([order] * len(found), abs=0.1)
    assert found
    TABLE.agrees(name, slopes)


@pytest.mark.slow
def test_what_orders_are_measured_against() -> None:
    """That of the body in a fluid agrees with 20 digits."""
    t, mu, g = kirchhoff_body()[2][2]
    (fluid,) = columns()[1]
    assert t == fluid.t_end
    assert np.abs(fluid.exact[0][0] - mu).max() < 2e-15
    assert np.abs(fluid.exact[1][0] - g).max() < 4e-15


@pytest.mark.slow
def test_references_are_those_of_another_method() -> None:
    """Of Gauss's method of order 8."""
    for column in columns():
        for problem in column:
            other = problem.end(lm.RKMK(tableau=gauss(4)), round(32 * problem.t_end))
            for a, b in zip(problem.exact, other):
                assert np.abs(a - b).max() < 1e-14 * max(1.0, np.abs(a).max())


if __name__ == "__main__":
    TABLE.main()
