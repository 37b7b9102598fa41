"""Functions of time given by tables: SciPy's values, exact quadratures, one native code for all
lengths, the same bits.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import liemech as lm
from liemech import errors
from liemech.compiler import kernel
from liemech.formulas.pytree import build, gatherer, layout_of, leaves

RNG = np.random.default_rng(14)
KNOTS = np.concatenate([[0.0], np.sort(RNG.uniform(0.0, 10.0, 18)), [10.0]])
VALUES = RNG.normal(size=(20, 2))


@lm.record
class Driven(lm.GroupEquation):
    """x' = f(t) in a vector space."""

    drive: lm.PiecewisePolynomial

    def velocity(self, t, g):
        return self.drive(t)


def driven(f: lm.PiecewisePolynomial) -> Driven:
    return Driven(lm.VectorSpace(2), f)


@pytest.mark.parametrize(
    ("maker", "values", "options"),
    [
        ("CubicSpline", VALUES, {}),
        ("CubicSpline", VALUES[:, 0], {"bc_type": "natural"}),
        ("PchipInterpolator", VALUES, {}),
        ("Akima1DInterpolator", VALUES, {}),
        ("CubicHermiteSpline", VALUES, {"dydx": VALUES[::-1]}),
        ("make_interp_spline", VALUES, {"k": 5}),
        ("make_interp_spline", VALUES[:, 1], {"k": 2}),
        ("BPoly", RNG.normal(size=(4, 19, 2)), {}),
    ],
)
def test_a_curve_of_scipy_has_its_values_and_slopes(maker, values, options):
    import scipy.interpolate as curves

    given = (values, KNOTS) if maker == "BPoly" else (KNOTS, values)
    curve = getattr(curves, maker)(*given, **options)
    f = lm.PiecewisePolynomial.of(curve)
    t = np.concatenate([RNG.uniform(0.0, 10.0, 200), KNOTS])
    size = np.abs(f.coefficients).max()  # of the polynomials, whose terms cancel
    assert np.abs(f(t) - curve(t)).max() < 1e-14 * size
    slope = np.array([lm.derivative(f, x, 1.0) for x in t.tolist()])
    assert np.abs(slope - curve(t, 1)).max() < 1e-12 * size
    assert np.abs(f.derivative()(t) - curve(t, 1)).max() < 1e-12 * size
    assert np.array_equal(f(t), np.array([f(x) for x in t.tolist()]))  # many at once, to the bit


def test_lines_and_steps_between_the_knots():
    line = lm.PiecewisePolynomial.linear(KNOTS, VALUES)
    t = RNG.uniform(0.0, 10.0, 100)
    assert np.allclose(line(t)[:, 1], np.interp(t, KNOTS, VALUES[:, 1]), rtol=0.0, atol=1e-14)
    pulse = lm.PiecewisePolynomial.constant([0.0, 5.0, 5.5, 9.0], [0.0, 3.0, 0.0])
    assert [pulse(x) for x in (0.0, 4.999, 5.0, 5.4, 5.5, 9.0)] == [0.0, 0.0, 3.0, 3.0, 0.0, 0.0]
    assert pulse.derivative()(5.2) == 0.0


def test_beyond_the_table_what_was_named():
    given = KNOTS + 1.0, VALUES[:, 0]
    held = lm.PiecewisePolynomial.cubic(*given, outside="hold")
    assert held(-7.0) == VALUES[0, 0] and abs(held(70.0) - VALUES[-1, 0]) < 1e-12
    assert lm.derivative(held, 70.0, 1.0) == 0.0
    with pytest.raises(errors.InvalidInput, match="not held"):
        held.derivative()
    again = lm.PiecewisePolynomial.linear(*given, outside="repeat")
    assert (
        abs(again(3.25 + 20.0) - again(3.25)) < 1e-12
        and abs(again(3.25 - 10.0) - again(3.25)) < 1e-12
    )
    strict = lm.PiecewisePolynomial.cubic(*given)
    for t in (0.99, 11.01, np.nan):
        with pytest.raises(ValueError, match=r'1\.0 to 11\.0, has no value; outside="hold"'):
            strict(t)
    assert np.isfinite(strict(np.nextafter(11.0, 12.0)))  # rounding of t + c h


def test_a_run_ends_where_its_table_does():
    system = driven(lm.PiecewisePolynomial.cubic(KNOTS, VALUES))
    start = system.state(np.zeros(2))
    whole = lm.integrate(system, lm.RKMK(order=5), start, t_end=10.0, compiled=False)
    assert whole.t[-1] == 10.0
    with pytest.raises(errors.IntegrationFailure, match=r"0\.0 to 10\.0") as caught:
        lm.integrate(system, lm.RKMK(order=4), start, h=0.5, steps=30, compiled=False)
    assert caught.value.trajectory.t[-1] == 10.0


def test_adaptive_steps_told_of_the_knots_integrate_jumps_exactly():
    """Between two knots the velocity is constant, and every step exact; without `breaks` the jumps
    cost steps and accuracy.
    """
    steps = lm.PiecewisePolynomial.constant(KNOTS, VALUES[1:])
    area = np.diff(KNOTS) @ VALUES[1:]
    system = driven(steps)
    told, not_told = (
        lm.integrate(
            system,
            lm.RKMK(order=5),
            system.state(np.zeros(2)),
            t_end=10.0,
            breaks=breaks,
            compiled=False,
        )
        for breaks in (steps.knots, ())
    )
    assert np.abs(told.g[-1] - area).max() < 1e-13 < np.abs(not_told.g[-1] - area).max()
    assert told.rejected == 0 < not_told.rejected


def test_a_cubic_table_is_integrated_exactly_by_simpsons_rule():
    from scipy.interpolate import CubicSpline

    knots = np.linspace(0.0, 10.0, 21)
    curve = CubicSpline(knots, RNG.normal(size=(21, 2)))
    system = driven(lm.PiecewisePolynomial.of(curve))
    run = lm.integrate(
        system, lm.RKMK(order=4), system.state(np.zeros(2)), h=0.5, steps=20, compiled=False
    )
    assert np.abs(run.g - [curve.integrate(0.0, t) for t in run.t]).max() < 1e-13


def test_tables_are_pickled_compared_and_saved(tmp_path: Path):
    system = driven(lm.PiecewisePolynomial.cubic(KNOTS, VALUES))
    other = driven(lm.PiecewisePolynomial.cubic(KNOTS, VALUES + 1e-16 * VALUES[0, 0] + 1e-9))
    assert pickle.loads(pickle.dumps(system)) == system != other and hash(system) == hash(
        pickle.loads(pickle.dumps(system))
    )
    plan = lm.Plan(system, lm.RKMK(order=2), h=0.1, compiled=False)
    run = plan.run(system.state(np.zeros(2)), steps=20)
    run.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    assert loaded.system == system
    rest = plan.resume(loaded, steps=20)
    assert np.array_equal(rest.g, plan.run(system.state(np.zeros(2)), steps=40).g[20:])
    with pytest.raises(errors.InvalidInput, match=r"drive\.coefficients"):
        plan.replace(system=other).resume(run, steps=1)
    with pytest.raises(errors.InvalidInput, match="no number"):
        plan.tangent(system.state(np.zeros(2)), steps=2, by="drive")


def test_a_table_is_one_number_wherever_values_are_laid_out():
    system = driven(lm.PiecewisePolynomial.cubic(KNOTS, VALUES))
    layout = layout_of(system)
    numbers = leaves(system, layout)
    assert len(numbers) == layout.width and gatherer(layout)(system) == numbers
    assert build(layout, iter(numbers)) == system
    assert layout == layout_of(
        driven(lm.PiecewisePolynomial.cubic(np.arange(500.0), RNG.normal(size=(500, 2))))
    )


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_is_one_for_tables_of_all_lengths_and_has_the_bits_of_python():
    long = np.linspace(0.0, 10.0, 3000)
    short, many = (
        lm.PiecewisePolynomial.cubic(KNOTS, VALUES),
        lm.PiecewisePolynomial.cubic(long, RNG.normal(size=(3000, 2))),
    )
    made = set()
    for f in (short, many):
        system = driven(f)
        start = system.state(np.zeros(2))
        plain, native = (
            lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=200, compiled=compiled)
            for compiled in (False, True)
        )
        assert np.array_equal(plain.g, native.g)
        made.add(len(kernel.alive()))
    assert len(made) == 1
    starts = system.state(RNG.normal(size=(5, 2)))
    systems = [driven(f) for f in (short, many, short, many, many)]
    together = lm.integrate(systems, lm.RKMK(order=4), starts, h=0.05, steps=100, compiled=True)
    for i, system in enumerate(systems):
        alone = lm.integrate(
            system, lm.RKMK(order=4), system.state(starts.g[i]), h=0.05, steps=100, compiled=False
        )
        assert np.array_equal(together.g[:, i], alone.g)


CONSTANT = lm.PiecewisePolynomial.linear(KNOTS, VALUES[:, 0], outside="repeat")


@lm.record
class Outside(lm.GroupEquation):
    """x' = f(t) with a table that is no field, but a constant of the code."""

    strength: float

    def velocity(self, t, g):
        return lm.vec(self.strength * CONSTANT(t), lm.derivative(CONSTANT, t))


@pytest.mark.compiled
def test_a_table_that_is_no_field_lies_in_the_code_and_is_looked_at_again(monkeypatch):
    system = Outside(lm.VectorSpace(2), 2.0)
    start = system.state(np.zeros(2))

    def runs():
        return [
            lm.integrate(system, lm.RKMK(order=4), start, h=0.7, steps=40, compiled=c).g
            for c in (False, True)
        ]

    plain, native = runs()
    assert np.array_equal(plain, native)
    monkeypatch.setattr(
        f"{__name__}.CONSTANT",
        lm.PiecewisePolynomial.linear(KNOTS, -VALUES[:, 0], outside="repeat"),
    )
    changed, native = runs()
    assert np.array_equal(changed, native) and np.array_equal(changed, -plain)


def test_what_is_no_table_is_refused():
    for knots, values, message in (
        ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "must rise"),
        ([0.0, 1.0], [1.0, 2.0, 3.0], "one value for each time"),
        ([0.0, np.inf], [1.0, 2.0], "finite"),
        ([0.0, 1.0], np.zeros((2, 3, 3)), r"\(n, dim\)"),
    ):
        with pytest.raises(errors.InvalidInput, match=message):
            lm.PiecewisePolynomial.linear(knots, values)
    with pytest.raises(errors.InvalidInput, match="between each two"):
        lm.PiecewisePolynomial.constant([0.0, 1.0], [1.0, 2.0])
    with pytest.raises(errors.InvalidInput, match="outside is"):
        lm.PiecewisePolynomial.linear([0.0, 1.0], [1.0, 2.0], outside="extrapolate")
    with pytest.raises(errors.InvalidType, match="spline of scipy"):
        lm.PiecewisePolynomial.of(np.sin)


def test_a_table_shows_its_ends():
    assert "t = 2 to 9," in repr(lm.PiecewisePolynomial.linear([2.0, 5.0, 9.0], [0.0, 1.0, 3.0]))
