"""What systems compute beside their motion, written down once more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Oscillator, heavy_top, kirchhoff_body
from scipy.interpolate import BPoly, CubicSpline, make_interp_spline

import liemech as lm
from liemech.formulas import sin, vec
from liemech.rooms.fictive_time.time_scales import EqualArc, EqualChange, EqualPath, OfState
from liemech.systems.parts import FunctionOfCoordinate, recognised, second_degree

# ---------------------------------------------------------------- time scales


@lm.record
class Tilted(lm.SeparableSystem):
    """Two coordinates with masses that differ."""

    degrees = 2

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * (p[0] * p[0] + 0.25 * p[1] * p[1])

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * (q @ q) + 0.2 * q[0] * q[0] * q[1]


Q, P = np.array([0.7, -0.4]), np.array([0.3, 0.9])
SLOPE = np.array([Q[0] + 0.4 * Q[0] * Q[1], Q[1] + 0.2 * Q[0] ** 2])
V = P * [1.0, 0.25]


def test_the_values_of_time_scales() -> None:
    system = Tilted()
    start = system.state(Q, P)
    kinetic = 0.5 * P @ V
    values = {
        EqualArc(): 1.0 / np.sqrt(V @ V + SLOPE @ SLOPE),
        lm.time_scales.DistancePower(1.5): np.linalg.norm(Q) ** 1.5,
        lm.time_scales.DistancePower(2.0): Q @ Q,
        EqualPath(): kinetic**-0.5,
        EqualChange(): (kinetic + SLOPE @ (SLOPE * [1.0, 0.25])) ** -0.5,
    }
    for scale, wanted in values.items():
        assert scale.bound(system, start).value(system, start) == pytest.approx(wanted, rel=1e-14)
    assert lm.time_scales.DistancePower(1.5).slope(system, start.q) == pytest.approx(
        1.5 * np.linalg.norm(Q) ** -0.5 * Q, rel=1e-14
    )
    top, begun = heavy_top()
    xi, force = np.array(top.velocity(begun.mu)), np.array(top.force(begun.g))
    assert EqualArc().value(top, begun) == pytest.approx(1.0 / np.sqrt(xi @ xi + force @ force), rel=1e-14)


def moved(system: Any, start: Any, h: float) -> Any:
    """The state a short time later."""
    return lm.integrate(system, lm.RKMK(order=4), start, h=h, steps=1, compiled=False).last


def cases() -> list[Any]:
    plane, (top, turning), (body, floating) = Tilted(), heavy_top(), kirchhoff_body()[:2]
    swinging = lm.SphericalPendulum()
    hanging = swinging.state([0.6, 0.0, -0.8], [0.4, 0.9, 0.3])
    water = lm.models.LotkaVolterra()
    return [
        (plane, plane.state(Q, P), EqualArc()),
        (plane, plane.state(Q, P), lm.time_scales.DistancePower(1.5)),
        (plane, plane.state(Q, P), OfState(lambda p: 1.0 + p @ p, ("p",))),
        (swinging, hanging, OfState(lambda q, p: 2.0 + q[0] * p[1] + p[2], ("q", "p"))),
        (top, turning, OfState(lambda mu: 2.0 + mu[0] + mu[1] * mu[2], ("mu",))),
        (top, turning, OfState(lambda g: 2.0 + g[0, 1] * g[2, 2], ("g",))),
        (top, turning, EqualArc()),
        (body, floating, OfState(lambda mu, g: 2.0 + mu[0] * g[0, 3] + mu[4], ("mu", "g"))),
        (water, water.state([1.3, 0.6]), OfState(lambda y: 1.0 + y[0] * y[1], ("y",))),
    ]


@pytest.mark.parametrize("case", range(9))
def test_how_time_scales_grow_along_the_motion(case: int) -> None:
    """d sigma/dt, by the motion forwards and backwards."""
    system, start, scale = cases()[case]
    h = 1e-4
    ends = [scale.value(system, moved(system, start, s)) for s in (h, -h)]
    assert abs(ends[0] - ends[1]) > 1e-6
    assert scale.growth(system, 0.0, start) == pytest.approx((ends[0] - ends[1]) / (2.0 * h), rel=1e-6)


# ---------------------------------------------------------------- potentials and fields


def test_a_sum_of_potentials() -> None:
    @lm.record
    class Sums(lm.MultirateSystem):
        degrees = 2
        parts = ("stiff", "middle", "soft")

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * (p @ p)

        def stiff(self, q: lm.Vec) -> float:
            return 8.0 * q[0] * q[0]

        def middle(self, q: lm.Vec) -> float:
            return 3.0 * q[0] * q[1]

        def soft(self, q: lm.Vec) -> float:
            return sin(q[1])

    system, (x, y) = Sums(), Q
    assert system.potential(vec(*Q)) == pytest.approx(8 * x * x + 3 * x * y + np.sin(y), rel=1e-14)
    wanted = [-16.0 * x - 3.0 * y, -3.0 * x - np.cos(y)]
    assert np.allclose(system.force(vec(*Q), vec(*P)), wanted, rtol=1e-14)


@lm.record
class Same(lm.Retraction):
    """The exponential under another name."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        return group.exp(xi)


@pytest.mark.parametrize("retraction", [lm.Exponential(), Same()])
def test_a_body_in_a_field_is_moved_by_element_and_kick(retraction: lm.Retraction) -> None:
    """(g h, Ad*_h (mu + n)) with (h, n) = tau(omega), of any retraction."""
    top, start = heavy_top()
    g, mu, w, f = np.array(start.g), np.array(start.mu), [0.3, -0.2, 0.5], [0.1, 0.4, -0.2]
    h = np.array(lm.SO3().exp(w))
    n = np.array(lm.SO3().dexp(w, f, side="right"))  # the same on vectors and covectors of rotations
    for kick, moved_by in ((f, n), ([0.0] * 3, 0.0)):
        end = top.displaced(retraction, start, vec(*w, *kick))
        assert np.allclose(end.g, g @ h, rtol=0.0, atol=1e-15)
        assert np.allclose(end.mu, h.T @ (mu + moved_by), rtol=0.0, atol=1e-15)


# ---------------------------------------------------------------- tables


def test_tables_of_vectors_and_their_derivatives() -> None:
    """Of a cubic, three components: any derivative, from SciPy's kinds of splines."""
    t = np.array([0.0, 0.4, 1.0, 1.7])
    values = np.stack([np.sin(t), t**2, np.cos(2.0 * t)], axis=-1)
    there = np.array([0.1, 0.4, 0.77, 1.5])
    spline = CubicSpline(t, values)
    made = [
        lm.PiecewisePolynomial.cubic(t, values),
        lm.PiecewisePolynomial.of(spline),
        lm.PiecewisePolynomial.of(make_interp_spline(t, values, k=3)),
        lm.PiecewisePolynomial.of(
            BPoly.from_derivatives(t, [[*zip(r, d)] and [r, d] for r, d in zip(values, spline(t, 1))])
        ),
    ]
    for table in made[:3]:
        for order in (0, 1, 2, 3, 4):
            f = table.derivative(order) if order else table
            assert np.allclose(f(there), spline(there, order), atol=1e-12)
            assert np.array_equal(f(there), [f(float(x)) for x in there])
        assert table.degree == 3 and table.derivative(4).degree == 0
    assert np.allclose(made[3](t[:-1]), values[:-1], atol=1e-14)
    assert np.allclose(made[3].derivative()(t[:-1]), spline(t[:-1], 1), atol=1e-13)
    one = lm.PiecewisePolynomial.cubic(t, values[:, 0])
    assert np.allclose(one.derivative(2)(there), CubicSpline(t, values[:, 0])(there, 2), atol=1e-12)


@pytest.mark.parametrize("past", [2.0**-49, -(2.0**-49)])
def test_tables_end_where_they_end_but_for_rounding(past: float) -> None:
    """2^-48 of the larger end is rounding: less is no time outside, more is one."""
    table = lm.PiecewisePolynomial.linear([-3.0, 1.0, 2.0], [1.0, 2.0, 5.0])
    first, last = -3.0 - 3.0 * abs(past), 2.0 + 3.0 * abs(past)
    assert table(last) == pytest.approx(5.0) and table(first) == pytest.approx(1.0)
    for outside in (2.0 + 3.0 * 2.3 * abs(past), -3.0 - 3.0 * 2.3 * abs(past)):
        with pytest.raises(ValueError, match="has no value"):
            table(outside)
    held = lm.PiecewisePolynomial.linear([-3.0, 1.0, 2.0], [1.0, 2.0, 5.0], "hold")
    assert held(9.0) == 5.0 and held(-9.0) == 1.0
    again = lm.PiecewisePolynomial.linear([-3.0, 1.0, 2.0], [1.0, 2.0, 5.0], "repeat")
    assert again(3.0 + 5.0) == pytest.approx(again(3.0)) == pytest.approx(table(-2.0))


@pytest.mark.parametrize(
    ("knots", "terms", "words"),
    [
        ([0.0, 1.0, 2.0], np.ones((3, 2)), r"for 3 knots the coefficients are \(2, degree \+ 1\)"),
        ([0.0, 1.0], np.ones(1), r"for 2 knots the coefficients are \(1,"),
        ([0.0, 1.0], np.ones((1, 2, 3, 4)), "for 2 knots"),
        ([0.0], np.ones((0, 2)), "two rising times"),
        ([0.0, 1.0, 1.0], np.ones((2, 2)), "two rising times"),
    ],
)
def test_tables_that_do_not_fit(knots: Any, terms: Any, words: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=words):
        lm.PiecewisePolynomial(knots, terms)


# ---------------------------------------------------------------- is T quadratic?


@pytest.mark.parametrize(("power", "wanted"), [(1, True), (2, True), (3, False), (4, False)])
def test_whether_a_kinetic_energy_is_of_second_degree(power: int, wanted: bool) -> None:
    @lm.record
    class Power(lm.SeparableSystem):
        degrees = 3

        def kinetic(self, p: lm.Vec) -> float:
            return p[0] ** power + p[1] ** power + p[2] ** power

        def potential(self, q: lm.Vec) -> float:
            return 0.5 * (q @ q)

    assert Power().quadratic is wanted and Oscillator(2.0).quadratic


# ---------------------------------------------------------------- inertias


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e9])
def test_which_inertias_are_singular_or_not_symmetric(factor: float) -> None:
    """Entries beside their mirror images to 1e-12 of their row and column; the least singular value
    beside the largest, in units in which rows can be compared.
    """
    mixed = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, 2.0], [0.5, 2.0, 1.0]])
    units = np.array([factor, 1.0, 1.0 / factor])
    for off, refused in ((0.5e-12, False), (2e-12, True)):
        m = mixed.copy()
        m[0, 1] += off * 6.0
        if refused:
            with pytest.raises(lm.errors.InvalidInput, match="not symmetric: \\[0, 1\\]"):
                lm.KineticEnergy(units[:, None] * m * units)
        else:
            lm.KineticEnergy(units[:, None] * m * units)
    e = np.array([0.6, 0.0, 0.8])
    for least, refused in ((3.0 * 2.0**-49, False), (0.0, True)):
        m = np.eye(3) - (1.0 - least) * np.outer(e, e)
        m = 0.5 * (m + m.T)
        if refused:
            with pytest.raises(lm.errors.InvalidInput, match="singular up to rounding"):
                lm.KineticEnergy(units[:, None] * m * units)
        else:
            lm.KineticEnergy(units[:, None] * m * units)
    indefinite = np.array([[0.0, 2.0], [2.0, 0.0]])  # no zero on the diagonal is a unit
    lm.KineticEnergy(factor * indefinite)


# ---------------------------------------------------------------- parts whose motion is known


@pytest.mark.parametrize("index", [0, 1, 2])
def test_energies_of_one_coordinate(index: int) -> None:
    @lm.record
    class Of(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return mu[index] ** 3 + sin(mu[index])

    part = recognised(lm.coadjoint(lm.SO3()).poisson_structure, Of())
    assert isinstance(part, FunctionOfCoordinate) and part.index == index


@pytest.mark.parametrize(("power", "field", "wanted"), [(2, 3, True), (3, 3, False), (2, 1, True), (4, 2, False)])
def test_which_splittings_are_of_second_degree(power: int, field: int, wanted: bool) -> None:
    """{V, {V, {V, T}}} = 0 for T of second degree in the momenta, whatever V is; on rotations for no such pair."""

    @lm.record
    class Kinetic(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return mu[1] ** power + 0.5 * mu[1]

    @lm.record
    class Position(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return mu[0] ** field

    assert second_degree(lm.structures.Canonical(1), Kinetic(), Position()) is wanted


def test_turns_make_no_pair_of_second_degree() -> None:
    """On the dual of so(3), where the motion of V is no straight line."""

    @lm.record
    class Turn(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * mu[0] * mu[0] + mu[0]

    @lm.record
    class Square(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return mu @ mu + 0.5 * mu[1] * mu[1]

    assert not second_degree(lm.coadjoint(lm.SO3()).poisson_structure, Square(), Turn())


def test_the_time_scale_of_a_logarithm() -> None:
    """-1/V."""
    scale = lm.LogarithmicHamiltonian(lm.Kepler()).sigma
    start = lm.Kepler(2.0).pericentre(0.5, 3.0)
    assert scale.value(lm.Kepler(2.0), start) == pytest.approx(1.5 / 2.0, rel=1e-15)
