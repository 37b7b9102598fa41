"""Compensated sums: numbers that remember what rounding takes from them, and long runs that are summed up with them."""

from __future__ import annotations

import operator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scenes import CAYLEY, EXP, METHODS, asymmetric_body, named, same_bits, slow

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.driver import read, write
from liemech.formulas import Complex, Dual, mat, plain, record, sqrt, vec, where
from liemech.formulas.classes.layouts import NUMBER, layout_of
from liemech.formulas.numbers.compensated import Compensated
from liemech.formulas.numbers.conversions import compensated, fitted

# ---------------------------------------------------------------- the numbers


def exact(x: Compensated) -> Fraction:
    return Fraction(x.value) + Fraction(x.rest)


@pytest.mark.slow
def test_a_million_tenths() -> None:
    total, ordinary = Compensated(0.0), 0.0
    for _ in range(10**6):
        total, ordinary = total + 0.1, ordinary + 0.1
    truth = 10**6 * Fraction(0.1)
    assert abs(ordinary - truth) > 1e-6
    assert abs(exact(total) - truth) < 1e-16 * truth
    assert total.value == float(truth)


def test_small_terms_are_not_lost() -> None:
    total = Compensated(1.0)
    for _ in range(1000):
        total = 1e-17 + total
    assert total.value == 1.0 + 1000e-17
    assert (total - 1.0).value == pytest.approx(1e-14, rel=1e-10)
    assert 1.0 + 1e-17 == 1.0


@pytest.mark.parametrize("seed", range(5))
def test_sums_are_as_accurate_as_their_terms(seed: int) -> None:
    """Sums and differences: each rounds in units of what is added, not of what is there."""
    rng = np.random.default_rng(seed)
    a, b, truth = Compensated(1.0), Compensated(3.0), Fraction(1)
    other = Fraction(3)
    for x in rng.normal(scale=1e-3, size=1000).tolist():
        a, b, truth, other = a + x, x - b, truth + Fraction(x), Fraction(x) - other
    ulp = 1000 * 3e-3 * 2.0**-53  # of terms of up to 3e-3
    assert abs(exact(a) - truth) < ulp
    assert abs(exact(b) - other) < ulp
    assert abs(exact(b + a) - (truth + other)) < 2 * ulp + 1e-16


def test_all_else_is_done_with_the_value() -> None:
    x = Compensated(2.0, 1e-17)
    products = (
        (x * x, 4.0),
        (3.0 * x, 6.0),
        (x / 4.0, 0.5),
        (1.0 / x, 0.5),
        (x**3, 8.0),
        (abs(-x), 2.0),
        (sqrt(x * 2.0), 2.0),
    )
    for found, wanted in products:
        assert type(found) is float
        assert found == wanted
    assert isinstance(x * Dual(1.0, 2.0), Dual)
    assert all([x > 1.0, x >= 2.0, x < 2.5, x <= 2.0, x == 2.0, operator.ne(x, 3.0), operator.lt(1.0, x)])
    assert isinstance(x + Dual(1.0, 2.0), Dual)
    assert float(x) == 2.0
    assert repr(x) == "(2.0 + 1e-17)"


def test_vectors_matrices_and_complex_numbers_of_them() -> None:
    v, m, z = (compensated(vec(1.0, 2.0)), compensated(mat((1.0, 2.0), (3.0, 4.0))), compensated(Complex(1.0, 2.0)))
    tiny = 1e-17
    assert [x.rest for x in v + vec(tiny, -tiny)] == [tiny, -tiny]
    assert [x.rest for row in m + tiny * m for x in row] == [tiny, 2e-17, 3e-17, 4e-17]
    assert (z + Complex(tiny, tiny)).re.rest == tiny
    assert plain(m @ v) == vec(5.0, 11.0)
    assert type((m @ v)[0]) is float
    assert plain(v) == vec(1.0, 2.0)
    assert plain(z) == Complex(1.0, 2.0)


def test_values_are_fitted_into_layouts() -> None:
    state = lm.BodyState(vec(1.0, 2.0, 3.0), None)
    remembering = layout_of(compensated(state))
    assert remembering.remembers
    assert not layout_of(state).remembers
    assert layout_of(fitted(state, remembering)) == remembering
    assert layout_of(fitted(compensated(state), layout_of(state))) == layout_of(state)
    assert fitted((compensated(1.0), "text"), layout_of((1.0, "text"))) == (1.0, "text")
    assert fitted(vec(1.0), NUMBER) == vec(1.0)  # what does not fit is not touched


def _march(n: Any, given: Any, out: Any) -> None:
    """A driver: compensated sums, products and choices, in plain Python or native code."""
    total = Compensated(read(given, 0, NUMBER))
    x = read(given, 1, NUMBER)
    for _ in range(n):
        total = total + x * total
        if total > 1.5:
            total = total - 0.5
        x = where(total > 1.2, -x, x)
    write(out, 0, total, layout_of(total))
    write(out, 2, sqrt(total), NUMBER)


@pytest.mark.compiled
def test_native_code_has_the_same_bits() -> None:
    given = np.array([1.0, 0.07])
    one, other = np.empty(3), np.empty(3)
    _march(1000, given, one)
    kernel.kernel(_march, 1000, given, other)(1000, given, other)
    assert same_bits(one, other)
    assert one[1] != 0.0


# ---------------------------------------------------------------- long runs


@record
class Drift(lm.GroupEquation):
    """x' = v in the space R^n."""

    v: lm.Vec

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        """v."""
        return self.v


@pytest.mark.slow
@pytest.mark.compiled
def test_a_uniform_motion_arrives_where_it_should() -> None:
    """A million steps of a constant velocity: the rounding errors, all alike, add up to 1e6 of them or to none."""
    system = Drift(lm.VectorSpace(2), vec(0.1, -0.3))
    start = system.state([0.0, 1.0])
    end = {
        c: lm.integrate(system, lm.RKMK(1), start, h=0.7, steps=10**6, every=10**6, compensated=c).g[-1]
        for c in (False, True)
    }
    step = [Fraction(0.7 * v) for v in (0.1, -0.3)]
    truth = np.array([float(10**6 * step[0]), float(1 + 10**6 * step[1])])
    assert np.abs(end[True] / truth - 1).max() < 3e-16
    assert np.abs(end[False] / truth - 1).max() > 1e-12


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [m if m is not EXP else slow(m) for m in METHODS], ids=named)
def test_what_a_million_steps_keep(method: lm.Method) -> None:
    """|mu|^2 of 16 bodies changes ten times less; so does the spatial momentum if the attitude is
    compensated too.
    """
    body, _ = asymmetric_body()
    mu = np.random.default_rng(1).normal(size=(16, 3))
    start = body.state(mu, np.broadcast_to(np.eye(3), (16, 3, 3)))
    casimir, momentum = {}, {}
    for mode in (False, None, True):
        run = lm.integrate(body, method, start, h=0.1, steps=10**6, every=10**6, compensated=mode, progress=False)
        change = run.spatial_momentum[-1] - run.spatial_momentum[0]
        casimir[mode] = np.sqrt(np.mean((run.casimirs[-1] / run.casimirs[0] - 1) ** 2))
        momentum[mode] = np.sqrt(np.mean(np.sum(change**2, axis=-1) / np.sum(mu**2, axis=-1)))
    assert casimir[True] < 1e-14
    assert momentum[True] < 2e-14
    assert casimir[False] > 5 * casimir[True]
    assert momentum[False] > 3 * momentum[True]
    assert casimir[None] == casimir[bool(method.symmetric)]


SUMMED = EXP, CAYLEY, lm.RKMK(4), lm.Composition(CAYLEY, 4), lm.ImplicitMidpoint()
PAIRS = [(method, mode) for method in SUMMED for mode in (False, None, True)]
QUICK = (CAYLEY, None), (CAYLEY, True), (lm.RKMK(4), True), (lm.ImplicitMidpoint(), None)
"""Sums of what the motion depends on, and of the attitude too; by methods with and without an
iteration.  All pairs are slow.
"""


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(("method", "mode"), [p if p in QUICK else slow(*p) for p in PAIRS])
def test_plain_and_native_and_ensembles_agree_to_the_bit(method: lm.Method, mode: bool | None) -> None:
    body, start = asymmetric_body()
    mu = np.array(start.mu) * np.linspace(0.5, 1.5, 9)[:, None]
    g = None if isinstance(method, lm.ImplicitMidpoint) else np.array(start.g)
    many = lm.integrate(body, method, body.state(mu, g), h=0.1, steps=50, compensated=mode, compiled=True)
    for i in (0, 8):
        for compiled in (False, True):
            one = lm.integrate(body, method, body.state(mu[i], g), h=0.1, steps=50, compensated=mode, compiled=compiled)
            assert same_bits(one.mu, many.mu[:, i])
            assert g is None or same_bits(one.g, many.g[:, i])


@pytest.mark.slow
def test_by_default_symmetric_methods_sum_up_what_the_motion_depends_on() -> None:
    body, start = asymmetric_body()
    runs = {
        c: lm.integrate(body, EXP, start, h=0.1, steps=100, compensated=c, compiled=False) for c in (False, None, True)
    }
    assert same_bits(runs[None].mu, runs[True].mu)
    assert not same_bits(runs[None].g, runs[True].g)
    assert not same_bits(runs[None].mu, runs[False].mu)
    assert np.abs(runs[None].mu - runs[False].mu).max() < 1e-14
    rkmk = {
        c: lm.integrate(body, lm.RKMK(4), start, h=0.1, steps=100, compensated=c, compiled=False) for c in (False, None)
    }
    assert same_bits(rkmk[None].mu, rkmk[False].mu)


@pytest.mark.sample(2)
@pytest.mark.parametrize("group", [lm.SE3(), lm.SU(2), lm.UnitQuaternions(), lm.SO(4)], ids=repr)
def test_on_other_groups(group: lm.LieGroup) -> None:
    """Whatever the elements are, the run is the same to rounding."""
    rng = np.random.default_rng(3)
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    start = system.state(rng.normal(size=group.dim), group.random(rng))
    one, other = (
        lm.integrate(system, EXP, start, h=0.1, steps=30, compensated=c, compiled=False) for c in (False, True)
    )
    assert np.abs(one.mu - other.mu).max() < 1e-13
    assert np.abs(one.g - other.g).max() < 1e-13
    assert not same_bits(one.mu, other.mu)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    ("group", "method", "size"),
    [
        pytest.param(lm.SO(4), lm.CommutatorFree(order=4), 1.0, id="SO(4)"),
        pytest.param(lm.SO(4), lm.CommutatorFree(order=4), 60.0, id="SO(4), large steps"),
        pytest.param(lm.UnitQuaternions(), lm.Composition(CAYLEY, order=4), 1.0, id="quaternions"),
    ],
)
def test_several_displacements_a_step_remember_in_native_code(
    group: lm.LieGroup, method: lm.Method, size: float
) -> None:
    """What a displacement leaves remembers, however large it was, or the next one could not be compiled."""
    body = lm.LiePoissonSystem(group, lm.KineticEnergy(1.0 + 0.1 * np.arange(group.dim)))
    start = body.state(size * np.linspace(-0.4, 0.5, group.dim), group.identity())
    plain_run, native, loose = (
        lm.integrate(body, method, start, h=0.1, steps=10, compiled=c, compensated=s)
        for c, s in ((False, True), (True, True), (False, False))
    )
    assert same_bits(plain_run.mu, native.mu)
    assert same_bits(plain_run.g, native.g)
    assert np.abs(native.mu - loose.mu).max() < 1e-12 * size


def test_what_cannot_be_meant() -> None:
    body, start = asymmetric_body()
    with pytest.raises(lm.errors.InvalidType, match="compensated must be True, False or None; got 'yes'"):
        lm.integrate(body, EXP, start, h=0.1, steps=1, compensated="yes")  # type: ignore[arg-type]


EPS = 2.0**-52
TOP = lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0])
START = TOP.state([0.5, 0.3, 2.8], np.eye(3))
METHODS = (
    lm.RKMK(order=4),
    lm.CommutatorFree(order=4),
    lm.CrouchGrossman(order=3),
    lm.Taylor(4, lm.Exponential()),
    lm.LieVerlet(),
)


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_a_step_keeps_what_rounding_takes(method: lm.Method) -> None:
    """The low parts are there after a step, and the value they belong to is that of an ordinary step, to rounding."""
    start = compensated(START)
    after = method.observe(method.step(TOP, 0.0, method.start(TOP, start, 0.1), 0.1))
    plain = method.observe(method.step(TOP, 0.0, method.start(TOP, START, 0.1), 0.1))
    numbers = [*after.mu, *(x for row in after.g for x in row)]
    assert all(isinstance(x, Compensated) for x in numbers)
    assert any(x.rest != 0.0 for x in numbers)
    expected = [*plain.mu, *(x for row in plain.g for x in row)]
    assert [x.value for x in numbers] == pytest.approx(expected, abs=8 * EPS)


@pytest.mark.slow
@pytest.mark.compiled
def test_what_it_brings() -> None:
    """Orthogonality after 20,000 steps of RKMK 4: rounding walks without it."""
    off = []
    for choice in (False, True):
        run = lm.integrate(
            TOP, lm.RKMK(order=4), START, h=0.01, steps=20_000, every=20_000, compensated=choice, compiled=True
        )
        off.append(np.abs(run.g[-1].T @ run.g[-1] - np.eye(3)).max())
    assert off[1] <= 6 * EPS
    assert off[0] >= 3 * off[1]


# ---------------------------------------------------------------- on one way only


@record
class Turning(lm.GroupEquation):
    """x' = (x_2, -x_1)."""

    def velocity(self, t: float, x: Any) -> Any:
        return vec(x[1], -x[0])


@record
class Saturated(lm.Method):
    """A step with a bound on one of its numbers."""

    order = 1
    symmetric = True
    kind: str

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        x = state.g
        bounded = max(plain(x[0]) if self.kind == "plain sum" else x[0], 0.1)
        share = -bounded * x[1] if self.kind == "product" else bounded + x[1]
        new = x + h * share * system.velocity(t, x)
        return type(state)(vec(where(new[0] < 0.5, new[0], 0.5), new[1]))


@pytest.mark.compiled
@pytest.mark.parametrize("kind", ["sum", "plain sum", "product"])
def test_a_number_that_remembers_on_one_way_only(kind: str) -> None:
    """Its sums are not those of an ordinary number; whatever else is done with it is."""
    system = Turning(lm.VectorSpace(2))
    for x in np.random.default_rng(5).normal(size=(8, 2)):
        runs = []
        for mode in (False, True):
            try:
                run = lm.integrate(system, Saturated(kind), system.state(x), h=0.1, steps=60, compiled=mode)
                runs.append(run)
            except lm.errors.NotCompilable as error:
                assert kind == "sum" and "remembers on one way only" in str(error)
                return
        assert np.array_equal(runs[0].g, runs[1].g)
    assert kind != "sum"
