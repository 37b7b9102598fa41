"""Functions of time given by tables: SciPy's values, exact quadratures, one native code for all lengths, the same bits."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech import errors
from liemech.compiler import kernel
from liemech.formulas.classes.layouts import build, gatherer, layout_of, leaves

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
    assert abs(again(3.25 + 20.0) - again(3.25)) < 1e-12 and abs(again(3.25 - 10.0) - again(3.25)) < 1e-12
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


@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.Taylor(order=8)], ids=repr)
def test_adaptive_steps_know_where_a_table_jumps(method):
    """Between two knots the velocity is constant, and every step exact."""
    steps = lm.PiecewisePolynomial.constant(KNOTS, VALUES[1:])
    area = np.diff(KNOTS) @ VALUES[1:]
    system = driven(steps)
    for breaks in (steps.knots, ()):
        run = lm.integrate(system, method, system.state(np.zeros(2)), t_end=10.0, breaks=breaks, compiled=False)
        assert np.abs(run.g[-1] - area).max() < 1e-13 and run.rejected == 0


@pytest.mark.parametrize(("t0", "t_end"), [(0.0, 2.1), (-2.7, 3.0), (2.0, -1.0)])
@pytest.mark.parametrize("ulps", [-8, -4, -3, -1, 1, 2, 3, 8])
def test_jumps_within_rounding_of_the_ends_stop_no_adaptive_run(t0, t_end, ulps):
    before, behind = min(t0, t_end) - 1.0, max(t0, t_end) + 1.0
    for end in t0, t_end:
        at = end + ulps * np.spacing(abs(end))
        table = lm.PiecewisePolynomial.constant([before, at, behind], [[1.0], [2.0]])
        first, second = (1.0, 2.0) if t_end > t0 else (2.0, 1.0)
        x = Driven(lm.VectorSpace(1), table)
        for start in x.state([0.0]), x.state(np.zeros((3, 1))):
            run = lm.integrate(x, lm.RKMK(order=5), start, t0=t0, t_end=t_end)
            exact = (t_end - t0) * (second if end == t0 else first)
            assert np.abs(run.g[-1] - exact).max() < 1e-13


def test_no_adaptive_step_goes_across_two_pulses():
    f = lm.PiecewisePolynomial.constant([0.0, 5.0, 5.01, 7.0, 7.02, 10.0], [0.0, 10.0, 0.0, 5.0, 0.0])
    system = Number(lm.VectorSpace(1), f)
    run = lm.integrate(system, lm.RKMK(order=5), system.state([0.0]), t_end=10.0, compiled=False)
    assert abs(run.g[-1, 0] - 0.2) < 10.0 * 1e-13


# ------------------------------------------------------------------ fixed steps


@lm.record
class Number(lm.GroupEquation):
    """x' = f(t), a number."""

    drive: lm.PiecewisePolynomial

    def velocity(self, t, g):
        return lm.vec(self.drive(t))


@lm.record
class Torque(lm.Force):
    """A torque that is known by a table."""

    torque: lm.PiecewisePolynomial

    def covector(self, t, xi, g):
        return self.torque(t)


def turned(f: lm.PiecewisePolynomial) -> lm.MechanicalSystem:
    """A body under such a torque."""
    return lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Torque(f))


START = {"mu": [1.0, 0.5, 0.2], "g": np.eye(3)}


def primitive(f: lm.PiecewisePolynomial, t: np.ndarray) -> np.ndarray:
    """The integral of a table of one period from its first knot, by SciPy."""
    from scipy.interpolate import PPoly

    terms = np.moveaxis(np.asarray(f.coefficients).reshape(len(f.knots) - 1, f.degree + 1, -1), 1, 0)
    curve = PPoly(terms[::-1], np.asarray(f.knots)).antiderivative()
    length = f.knots.array[-1] - f.knots.array[0]
    turns = np.floor((t - f.knots.array[0]) / length)
    whole = curve(f.knots.array[-1] - 1e-300)
    return turns[:, None] * whole + curve(t - turns * length)


@pytest.mark.parametrize(
    ("method", "outside"),
    [(lm.RKMK(order=4), "refuse"), (lm.Taylor(order=6), "hold"), (lm.RKMK(order=2), "repeat")],
    ids=repr,
)
def test_held_values_are_integrated_exactly_whether_knots_are_ends_of_steps_or_not(method, outside):
    """Forwards and backwards, with knots at multiples of h, between them, several in one step, and
    so that t + h misses them by rounding: 292 * 0.01 + 0.01 < 2.93.
    """
    rng = np.random.default_rng(2)
    for knots, h, steps in (
        (np.arange(81) * 0.05, 0.05, 80),
        (np.arange(81) * 0.05, 0.025, 100),
        (np.arange(81) * 0.05, 0.13, 30),
        ([0.0, 2.9, 2.93, 4.0], 0.01, 300),
        ([0.0, 0.31, 1.47, 1.5, 4.0], 0.2, 20),
    ):
        values = rng.normal(size=(len(knots) - 1, 2))
        f = lm.PiecewisePolynomial.constant(knots, values, outside)
        system = driven(f)
        for sign in (1.0, -1.0):
            t0 = 0.0 if sign > 0.0 else h * steps
            begin = system.state(np.zeros(2))
            run = lm.integrate(system, method, begin, h=sign * h, steps=steps, t0=t0, compiled=False)
            t = np.clip(run.t, 0.0, 4.0)
            wanted = primitive(f, t) - primitive(f, np.array([t0]))
            assert np.abs(run.g - wanted).max() < 1e-13


@pytest.mark.parametrize("kind", ["constant", "linear", "polynomial"])
def test_a_table_that_is_repeated_jumps_where_it_begins_anew(kind):
    rng = np.random.default_rng(5)
    knots = np.array([0.0, 0.2, 0.7, 1.0]) + 0.3
    f = {
        "constant": lambda: lm.PiecewisePolynomial.constant(knots, rng.normal(size=(3, 2)), "repeat"),
        "linear": lambda: lm.PiecewisePolynomial.linear(knots, rng.normal(size=(4, 2)), "repeat"),
        "polynomial": lambda: lm.PiecewisePolynomial(knots, rng.normal(size=(3, 4, 2)), "repeat"),
    }[kind]()
    system = driven(f)
    for t0, h, steps in ((0.3, 0.1, 40), (0.3, 1.0, 4), (0.0, 0.07, 40), (0.3, -0.1, 40), (0.3, 2.5, 2)):
        run = lm.integrate(
            system, lm.Taylor(order=6), system.state(np.zeros(2)), h=h, steps=steps, t0=t0, compiled=False
        )
        wanted = primitive(f, run.t) - primitive(f, np.array([t0]))
        assert np.abs(run.g - wanted).max() < 1e-13 * max(1.0, np.abs(wanted).max())


SWITCHED = lm.PiecewisePolynomial.constant(
    [0.0, 0.31, 0.8, 1.47, 1.5, 2.0], np.random.default_rng(6).normal(size=(5, 3))
)


def momentum_at_the_end() -> np.ndarray:
    """Of the body under that torque, by SciPy from jump to jump."""
    from scipy.integrate import solve_ivp

    inertia, mu = np.array([1.0, 1.5, 2.0]), np.array(START["mu"])
    for a, b in zip(SWITCHED.knots.array[:-1], SWITCHED.knots.array[1:], strict=True):
        torque = SWITCHED(0.5 * (a + b))
        mu = solve_ivp(
            lambda t, m, torque=torque: np.cross(m, m / inertia) + torque, (a, b), mu,
            method="DOP853", rtol=1e-13, atol=1e-14,
        ).y[:, -1]  # fmt: skip
    return mu


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    [
        lm.RKMK(order=4),
        lm.CommutatorFree(order=4),
        lm.LieVerlet(),
        lm.KickDrift(),
        lm.Composition(lm.LieVerlet(), order=4),
        lm.RKMK(tableau=lm.tableaus.gauss(2)),
        lm.Taylor(order=4, retraction=lm.Exponential()),
    ],
    ids=repr,
)
def test_methods_keep_their_order_and_symmetry_where_inputs_jump_inside_of_steps(method):
    system, wanted = turned(SWITCHED), momentum_at_the_end()
    begin, errors = system.state(**START), []
    for n in (20, 40) if method.analytic else (20, 40, 80):
        run = lm.integrate(system, method, begin, h=2.0 / n, steps=n, compiled=False)
        errors.append(np.abs(run.mu[-1] - wanted).max())
        if n == 20 and method.symmetric:
            there = system.state(mu=run.mu[-1], g=run.g[-1])
            back = lm.integrate(system, method, there, h=-2.0 / n, steps=n, t0=2.0, compiled=False)
            assert np.abs(back.mu[-1] - START["mu"]).max() < 1e-13
            assert np.abs(back.g[-1] - np.eye(3)).max() < 1e-13
    slopes = np.diff(np.log2(errors)) * -1.0
    assert (np.abs(slopes - method.order) < 0.25).all() or errors[-1] < 1e-12


@pytest.mark.slow
def test_controlled_steps_are_cut_where_inputs_jump_too():
    held = lm.PiecewisePolynomial(SWITCHED.knots, SWITCHED._terms(), "hold")
    system, wanted, errors = turned(held), momentum_at_the_end(), []
    base = lm.Composition(lm.LieVerlet(), order=4)
    method = lm.ReversibleController(base, lambda g: 1.0 / (1.5 + 0.3 * g[2, 2]))
    for h in (0.1, 0.05, 0.025):
        run = lm.integrate(system, method, system.state(**START), h=h, t_end=2.0, compiled=False)
        errors.append(np.abs(run.mu[-1] - wanted).max())
    assert (np.abs(np.diff(np.log2(errors)) + 4.0) < 0.4).all()


def test_steps_in_fictive_time_warn_of_jumps_that_they_go_across():
    held = lm.PiecewisePolynomial(SWITCHED.knots, SWITCHED._terms(), "hold")
    with pytest.warns(lm.errors.OrderWarning, match=r"an input of .* jumps.*ReversibleController"):
        lm.SundmanTransformed(turned(held), lambda g: 1.0 / (1.5 + 0.3 * g[2, 2]))
    smooth = lm.PiecewisePolynomial.linear([0.0, 1.0, 2.0], [[0.0] * 3, [1.0] * 3, [0.0] * 3], "hold")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lm.SundmanTransformed(turned(smooth), lambda g: 1.0 / (1.5 + 0.3 * g[2, 2]))


@lm.record
class Switch(lm.Force):
    """A torque that a formula switches, which no table tells."""

    at: float

    def covector(self, t, xi, g):
        return lm.vec(lm.formulas.where(t < self.at, 1.0, -2.0), 0.3, 0.0)


@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieVerlet()], ids=repr)
@pytest.mark.parametrize("at", [0.9, 0.93])
def test_steps_of_one_length_end_at_breaks_that_a_user_names(method, at):
    system = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Switch(at))
    same = lm.PiecewisePolynomial.constant([0.0, at, 2.0], [[1.0, 0.3, 0.0], [-2.0, 0.3, 0.0]])
    runs = [
        lm.integrate(one, method, one.state(**START), h=0.05, steps=40, breaks=breaks, compiled=False)
        for one, breaks in ((system, [at]), (turned(same), ()), (system, ()))
    ]
    assert np.abs(runs[0].mu - runs[1].mu).max() < 1e-13
    assert np.abs(runs[2].mu - runs[1].mu).max() > 1e-3  # without them it is of order one
    middle = runs[0].at(at + 0.012).mu - runs[1].at(at + 0.012).mu
    assert np.abs(middle).max() < 1e-13
    assert runs[0].t[-1] == 2.0 and len(runs[0]) == 41  # samples are at the ends of whole steps


@lm.record
class Reversed(lm.GroupEquation):
    """x' = 1 before the time zero, and -2 from then on."""

    def velocity(self, t, g):
        return lm.vec(lm.formulas.where(t < 0.0, 1.0, -2.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.RKMK(order=5)], ids=repr)
def test_a_break_at_time_zero_which_sums_of_steps_miss_by_rounding(method, sign):
    assert -1e-16 < -0.45 + 3 * 0.15 < 0.0
    system = Reversed(lm.VectorSpace(1))
    options = {"t0": sign * -0.45, "breaks": [0.0], "compiled": False}
    fixed = lm.integrate(system, method, system.state([0.0]), h=sign * 0.15, steps=6, **options)
    assert abs(fixed.g[-1, 0] + sign * 0.45) < 1e-14
    if method.error_order:
        run = lm.integrate(system, method, system.state([0.0]), t_end=sign * 0.45, **options)
        assert abs(run.g[-1, 0] - fixed.g[-1, 0]) < 1e-14


def test_a_plan_goes_on_across_breaks_bit_for_bit(tmp_path: Path):
    system = turned(SWITCHED)
    plan = lm.Plan(system, lm.LieVerlet(), h=0.07, breaks=[0.5], compiled=False)
    begin = system.state(**START)
    whole, first = plan.run(begin, steps=25), plan.run(begin, steps=11)
    rest = plan.resume(first, steps=14)
    first.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    again, body = plan.resume(loaded, steps=14), plan.stepper(begin)
    body.step(25)
    for mu in (rest.mu[-1], again.mu[-1], body.mu):
        assert np.array_equal(mu, whole.mu[-1])
    at = 0.523
    assert np.array_equal(loaded.at(at).mu, whole.at(at).mu)


@pytest.mark.slow
def test_the_tangent_of_a_run_across_jumps_is_its_derivative():
    system = turned(SWITCHED)
    plan = lm.Plan(system, lm.LieVerlet(), h=0.1, compiled=False)
    made = plan.tangent(system.state(**START), steps=20, by=("start", "body.inertia"))
    step = 1e-5
    ends = [plan.run(system.state(mu=[1.0 + x, 0.5, 0.2], g=np.eye(3)), steps=20).mu[-1] for x in (step, -step)]
    assert np.abs(made.tangent["start"][-1][:3, 0] - (ends[0] - ends[1]) / (2 * step)).max() < 1e-8
    with pytest.raises(errors.IncompatibleSystem, match="whatever h is"):
        plan.tangent(system.state(**START), steps=2, by="h")


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [lm.LieVerlet(), lm.RKMK(order=4)], ids=repr)
def test_bodies_with_tables_of_their_own_have_the_bits_of_single_runs(method):
    rng = np.random.default_rng(8)
    for outside, h, steps, t0 in (("repeat", 0.07, 30, -0.5), ("hold", -0.1, 25, 1.0)):
        systems = [
            turned(
                lm.PiecewisePolynomial(
                    np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, n - 1)), [1.0]]),
                    rng.normal(size=(n, 2, 3)), outside,
                )
            )
            for n in (1, 3, 6, 2, 4)
        ]  # fmt: skip
        mu, g = rng.normal(size=(5, 3)), np.broadcast_to(np.eye(3), (5, 3, 3))
        starts = systems[0].state(mu=mu, g=g)
        options = {"h": h, "steps": steps, "t0": t0}
        together = lm.integrate(systems, method, starts, compiled=True, **options)
        for i, system in enumerate(systems):
            begin = system.state(mu=mu[i], g=g[i])
            for compiled in (False, True):
                alone = lm.integrate(system, method, begin, compiled=compiled, **options)
                assert np.array_equal(together.mu[:, i], alone.mu)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("precision", ["double", pytest.param("double-double", marks=pytest.mark.slow)])
def test_steps_across_jumps_are_the_same_bits_in_native_code(precision):
    system = turned(SWITCHED)
    runs = [
        lm.integrate(
            system, lm.RKMK(order=4), system.state(**START), h=0.07, steps=28, compiled=compiled,
            precision=precision,
        )
        for compiled in (False, True)
    ]  # fmt: skip
    assert np.array_equal(runs[0].mu, runs[1].mu) and np.array_equal(runs[0].g, runs[1].g)


def test_a_cubic_table_is_integrated_exactly_by_simpsons_rule():
    from scipy.interpolate import CubicSpline

    knots = np.linspace(0.0, 10.0, 21)
    curve = CubicSpline(knots, RNG.normal(size=(21, 2)))
    system = driven(lm.PiecewisePolynomial.of(curve))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(np.zeros(2)), h=0.5, steps=20, compiled=False)
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
    assert layout == layout_of(driven(lm.PiecewisePolynomial.cubic(np.arange(500.0), RNG.normal(size=(500, 2)))))


@pytest.mark.slow
@pytest.mark.compiled
@lm.record
class Delayed(lm.GroupEquation):
    """x' = f(pace t - delay) in a vector space."""

    drive: lm.PiecewisePolynomial
    delay: float
    pace: float = 1.0

    def velocity(self, t, g):
        return self.drive(self.pace * t - self.delay)


@pytest.mark.parametrize("outside", ["refuse", "hold", "repeat"])
@pytest.mark.parametrize(("delay", "pace"), [(0.25, 1.0), (3.0, 1.0), (-1.5, 1.0), (-8.0, -1.0), (1.0, 2.0)])
@pytest.mark.parametrize("compiled", [False, None])
def test_a_table_is_right_at_other_times_than_those_of_the_step(outside, delay, pace, compiled):
    # Simpson's rule is exact for cubics, the knots are ends of steps
    from scipy.interpolate import CubicSpline

    knots = np.linspace(-4.0, 12.0, 33)
    waves = np.column_stack([np.sin(knots), np.cos(2.0 * np.pi * knots / 16.0)])
    curve = CubicSpline(knots, waves)
    system = Delayed(lm.VectorSpace(2), lm.PiecewisePolynomial.of(curve, outside), delay, pace)
    run = lm.integrate(system, lm.RKMK(order=4), system.state([0.0, 0.0]), h=0.25, steps=20, compiled=compiled)
    exact = [curve.integrate(-delay, pace * t - delay) / pace for t in run.t.tolist()]
    assert np.abs(run.g - exact).max() < 1e-13


@lm.record
class Pushed(lm.DrivenHamiltonianSystem):
    """A bead on a spring, pushed."""

    degrees: ClassVar[int] = 1
    push: lm.PiecewisePolynomial

    def energy(self, t, q, p):
        return 0.5 * p[0] ** 2 + 0.5 * q[0] ** 2 - self.push(t) * q[0]


@pytest.mark.slow
@pytest.mark.parametrize("until", [3.0, 0.25])
@pytest.mark.filterwarnings("ignore:integrate. 5 of 5")
def test_implicit_methods_of_ensembles_see_where_a_table_ends(until):
    """In lanes a solver goes on for some bodies only, and the table may refuse a time there."""
    times = np.linspace(-1.0, until, 9)
    system = Pushed(lm.PiecewisePolynomial.cubic(times, np.sin(times)))
    starts = system.state(RNG.normal(size=(5, 1)), RNG.normal(size=(5, 1)))
    plain, native = (
        lm.integrate(system, lm.HamiltonJacobi(2), starts, h=0.1, steps=5, compiled=compiled)
        for compiled in (False, True)
    )
    assert np.array_equal(plain.q, native.q, equal_nan=True)
    for run in plain, native:
        assert len(run.stopped) == (0 if until > 1.0 else 5)


@lm.record
class Cam(lm.HamiltonianSystem):
    """A bead whose potential is a table of its place."""

    degrees: ClassVar[int] = 1
    potential: lm.PiecewisePolynomial

    def energy(self, q, p):
        return 0.5 * p[0] ** 2 + self.potential(q[0])


@pytest.mark.slow
def test_a_table_of_places_is_looked_at_everywhere():
    places = np.linspace(-4.0, 4.0, 401)
    cam = Cam(lm.PiecewisePolynomial.cubic(places, 0.5 * places**2))  # to rounding a harmonic one
    for method in lm.RKMK(order=8), lm.HamiltonJacobi(order=4):
        run = lm.integrate(cam, method, cam.state(q=2.0, p=0.3), h=0.01, steps=300)
        exact = 2.0 * np.cos(run.t) + 0.3 * np.sin(run.t)
        assert np.abs(run.q[:, 0] - exact).max() < 1e-8


@pytest.mark.slow
def test_stages_beyond_a_step_see_a_fine_table_as_it_is():
    # substeps of the triple jump leave the step by a third of it, forty intervals
    from liemech.tableaus.compositions import TRIPLE_JUMP4

    knots = np.linspace(-1.0, 6.0, 7 * 128 + 1)
    torque = lm.PiecewisePolynomial.cubic(knots, np.column_stack([np.cos(knots), 0.0 * knots, 0.0 * knots]))
    body = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Torque(torque))
    jumps = lm.Composition(lm.KickDrift(), tableau=TRIPLE_JUMP4)
    errors = []
    for h in 0.25, 0.125:
        run = lm.integrate(body, jumps, body.state([0.0, 0.0, 0.0], np.eye(3)), h=h, steps=round(5.0 / h))
        errors.append(np.abs(run.mu[:, 0] - np.sin(run.t)).max())
    assert errors[0] < 2e-4 and errors[0] / errors[1] > 12.0


@pytest.mark.slow
@pytest.mark.parametrize("outside", ["refuse", "hold", "repeat"])
def test_stages_beyond_a_step_do_not_look_behind_a_jump(outside):
    from liemech.tableaus.compositions import TRIPLE_JUMP4, YOSHIDA6

    knots = [-1.0, 0.33, 1.0, 1.4142, 5.0]
    push = lm.PiecewisePolynomial.constant(knots, np.outer([0.3, 2.0, -1.0, 0.5], [1.0, 0.2, -0.5]), outside)
    body = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Torque(push))
    start = body.state([0.3, 0.5, -0.7], np.eye(3))
    exact = lm.integrate(body, lm.RKMK(order=8), start, h=0.02, steps=100).mu[-1]
    for tableau in TRIPLE_JUMP4, YOSHIDA6:
        method = lm.Composition(lm.KickDrift(), tableau=tableau)
        for steps in 80, 160:
            run = lm.integrate(body, method, start, h=2.0 / steps, steps=steps)
            assert np.abs(run.mu[-1] - exact).max() < 2e-6


@pytest.mark.slow
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
        alone = lm.integrate(system, lm.RKMK(order=4), system.state(starts.g[i]), h=0.05, steps=100, compiled=False)
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
        return [lm.integrate(system, lm.RKMK(order=4), start, h=0.7, steps=40, compiled=c).g for c in (False, True)]

    plain, native = runs()
    assert np.array_equal(plain, native)
    monkeypatch.setattr(f"{__name__}.CONSTANT", lm.PiecewisePolynomial.linear(KNOTS, -VALUES[:, 0], outside="repeat"))
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


ODD_TIMES = (0.0, -0.0, 1e-300, 1e300, np.inf, -np.inf, np.nan)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("outside", ["refuse", "hold", "repeat"])
def test_no_formula_reads_beyond_a_table(monkeypatch, outside):
    """Native code does not look where a table ends, and computes the same indices as plain Python."""
    from liemech.formulas import tables
    from liemech.integrators import ending_at_jumps
    from liemech.systems.in_time import knots as beside_knots
    from liemech.systems.in_time import tabulated

    def looked_at(table, i):
        assert type(i) is int and 0 <= i < len(table)
        return table.array.item(i)

    for module in tables, beside_knots, tabulated, ending_at_jumps:
        monkeypatch.setattr(module, "entry", looked_at)
    rng = np.random.default_rng(8)
    for _ in range(25):
        knots = np.cumsum(rng.uniform(0.1, 1.0, rng.integers(2, 6))) - 1.0
        steps = np.round(rng.normal(size=(len(knots) - 1, 2)))
        f = (
            lm.PiecewisePolynomial.linear(knots, np.stack([knots, -knots], axis=1), outside)
            if rng.random() < 0.3
            else lm.PiecewisePolynomial.constant(knots, steps, outside)
        )
        stops = ending_at_jumps.ending_at_jumps(lm.RKMK(order=4), driven(f), knots.tolist())
        times = [*rng.normal(size=3), *rng.choice(knots, 2), *ODD_TIMES]
        for t in times:
            for h in [*rng.normal(size=2), *(rng.choice(knots, 2) - t), *rng.choice(ODD_TIMES, 2)]:
                for beyond in (None, 0.0, 1.7):
                    seen = f.during(float(t), float(h), beyond)
                    for when in (t, t + h, t - 0.3 * h, *rng.choice(times, 2)):
                        try:
                            seen(float(when))
                        except ValueError as error:  # and none of another function
                            assert "has no value" in str(error)
                for every in (False, True):
                    f.jump_ahead(float(t), float(t + h), every)
                stops._break_before(float(t))
