"""Steps in numbers of two doubles: structure and ways back to 30 digits, the samples of ordinary
steps, the same bits natively.
"""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import CAYLEY, EXP, asymmetric_body, heavy_top, named, same_bits, slow

import liemech as lm
from liemech.errors import InvalidInput, InvalidType
from liemech.formulas import acos, asin, atan2, cbrt, cos, cosh, derivative, exp, log, pow, sin, solve, sqrt, tanh
from liemech.formulas.classes.layouts import build, layout_of, leaves
from liemech.formulas.numbers.conversions import double_double
from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.groups.rigid import rotation_coefficients
from liemech.tableaus import gauss

PENDULUM = json.loads((Path(__file__).parent.parent / "reference" / "pendulum.json").read_text())


def exactly(x: DoubleDouble) -> mp.mpf:
    return mp.mpf(x.value) + mp.mpf(x.low)


def numbers(count: int) -> list[DoubleDouble]:
    """Numbers of all signs and of sizes from 1e-3 to 1e2, with words of their own."""
    rng = np.random.default_rng(5)
    sizes = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-3, 2, count)
    return [
        DoubleDouble(x, 0.0) + 1e-17 * x * w
        for x, w in zip(sizes.tolist(), rng.uniform(-1, 1, count).tolist(), strict=True)
    ]


def test_arithmetic_has_31_digits() -> None:
    with mp.workdps(60):
        for a, b in zip(numbers(200), numbers(400)[200:], strict=True):
            A, B = exactly(a), exactly(b)
            x = b.value
            for got, want, size in (
                (a + b, A + B, abs(A) + abs(B)),
                (a - x, A - x, abs(A) + abs(x)),
                (x - a, x - A, abs(A) + abs(x)),
                (a * b, A * B, abs(A * B)),
                (x * a, x * A, abs(x * A)),
                (a / b, A / B, abs(A / B)),
                (a / x, A / x, abs(A / x)),
                (x / a, x / A, abs(x / A)),
                (a**3, A**3, abs(A**3)),
                (abs(a) ** 1.5, abs(A) ** mp.mpf(1.5), 10 * abs(A) ** mp.mpf(1.5)),
            ):
                assert abs(exactly(got) - want) < mp.mpf(2) ** -103 * size


def test_elementary_functions_have_31_digits() -> None:
    """sqrt, cbrt, exp, log, sines, their inverses, relative to the function, or to the angle where that is lost in it."""
    with mp.workdps(60):
        for a in numbers(100):
            A, s = exactly(a), a / (abs(a) + 1.0)
            S = exactly(s)
            for got, want, size in (
                (sin(a), mp.sin(A), max(abs(mp.sin(A)), abs(A))),
                (cos(a), mp.cos(A), max(abs(mp.cos(A)), abs(A))),
                (exp(a), mp.exp(A), (1 + abs(A)) * mp.exp(A)),
                (tanh(a), mp.tanh(A), abs(mp.tanh(A))),
                (cbrt(a), mp.sign(A) * mp.cbrt(abs(A)), mp.cbrt(abs(A))),
                (sqrt(abs(a)), mp.sqrt(abs(A)), mp.sqrt(abs(A))),
                (log(abs(a)), mp.log(abs(A)), abs(mp.log(abs(A)))),
                (asin(s), mp.asin(S), abs(mp.asin(S))),
                (acos(s), mp.acos(S), abs(mp.acos(S))),
                (atan2(a, s), mp.atan2(A, S), abs(mp.atan2(A, S))),
            ):
                assert abs(exactly(got) - want) < mp.mpf(2) ** -101 * size


@pytest.mark.parametrize("theta", [1e-9, 0.3, 0.9999, 1.0001, 3.0, 6.2])
def test_coefficients_of_rotations_have_28_digits(theta: float) -> None:
    """On both sides of where series end."""
    x = DoubleDouble(theta, 0.0) * theta
    with mp.workdps(80):
        t = mp.sqrt(exactly(x))
        cot = t / 2 * mp.cot(t / 2)
        sinc, versine, segment = mp.sin(t) / t, (1 - mp.cos(t)) / t**2, (t - mp.sin(t)) / t**3
        wanted = (
            *(sinc, versine, segment, (segment - versine) / 2),
            *((sinc - 2 * versine) / (2 * t**2), (versine - 3 * segment) / (2 * t**2)),
            *((1 - cot) / t**2, ((cot**2 - cot + t**2 / 4) / 2 - (1 - cot)) / t**4),
        )
        got = (*rotation_coefficients.all_coefficients(x), *rotation_coefficients.bernoulli_coefficients(x))
        for a, b in zip(got, wanted, strict=True):
            assert abs(exactly(a) - b) < mp.mpf(10) ** -28 * abs(b)
        assert rotation_coefficients.exp_coefficients(x)[1] == got[1]


@pytest.mark.parametrize("theta", [0.1, 0.6, 0.9999, 1.0001, 3.0, 6.2])
def test_derivatives_of_coefficients_of_rotations_have_28_digits(theta: float) -> None:
    """Of sinc, versine and segment, of which these follow: (segment - versine)/2, ..."""
    x = DoubleDouble(theta * theta)
    _, _, _, *wanted = rotation_coefficients.all_coefficients(x)
    got = derivative(lambda y: lm.vec(*rotation_coefficients.all_coefficients(y)[:3]), x)
    with mp.workdps(60):
        for a, b in zip(got, wanted, strict=True):
            assert abs(exactly(a) / exactly(b) - 1) < mp.mpf(10) ** -28


def test_equations_of_which_some_coefficients_carry_derivatives() -> None:
    """x_1 of a linear system by its first coefficient m: -x_1 (M^-1)_11."""
    rows = [[2.0 if i == j else 0.1 * i + 0.2 * j for j in range(4)] for i in range(4)]

    def solution(m: Any) -> Any:
        matrix = [
            lm.vec(*[m if i == j == 0 else DoubleDouble(x) for j, x in enumerate(row)]) for i, row in enumerate(rows)
        ]
        return solve(lm.mat(*matrix), lm.vec(1.0, 2.0, 0.5, 0.1))

    got = derivative(solution, DoubleDouble(1.5))[0]
    with mp.workdps(40):
        inverse = mp.inverse(mp.matrix([[1.5, *rows[0][1:]], *rows[1:]]))
        wanted = -(inverse * mp.matrix([1.0, 2.0, 0.5, 0.1]))[0] * inverse[0, 0]
        assert abs(exactly(got) / wanted - 1) < mp.mpf(10) ** -28


def pendulum() -> tuple[Any, Any]:
    system = lm.models.Pendulum()
    return system, system.state(0.9, 0.3)


def rod() -> tuple[Any, Any]:
    system = lm.SphericalPendulum()
    return system, system.state([0.0, 0.0, -1.0], [0.4, 1.5, 0.0])


def four() -> tuple[Any, Any]:
    system = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.3, 0.8, 1.1, 0.9, 1.4]))
    return system, system.state([0.6, -0.5, 0.4, 0.7, 0.3, -0.2], lm.SO(4).random(1))


def spin() -> tuple[Any, Any]:
    system = lm.LiePoissonSystem(lm.SU(2), lm.KineticEnergy([1.0, 1.6, 2.3]))
    return system, system.state([0.6, -0.5, 0.4], lm.SU(2).random(1))


CASES = [
    (EXP, asymmetric_body),
    (CAYLEY, asymmetric_body),
    (lm.Composition(CAYLEY, order=4), asymmetric_body),
    (lm.LieVerlet(lm.Cayley()), heavy_top),
    (CAYLEY, four),
    (EXP, four),
    (lm.GalerkinVariational(order=2), heavy_top),
    (lm.GalerkinVariational(order=2), spin),
    (lm.SymplecticRKMK(order=6), heavy_top),
    (lm.StormerVerlet(), pendulum),
    (lm.Splitting(order=6), pendulum),
    (lm.RATTLE(), rod),
    (lm.ImplicitMidpoint(), asymmetric_body),
    (lm.LiePoissonHamiltonJacobi(4, lm.Cayley()), asymmetric_body),
]


@pytest.mark.sample(4)
@pytest.mark.parametrize("method, scene", CASES, ids=lambda x: named(x) if isinstance(x, lm.Method) else x.__name__)
def test_the_way_back_ends_where_it_began_to_26_digits(method: Any, scene: Any) -> None:
    """Three steps of h and three of -h of a symmetric method; ordinary numbers show the same samples to rounding."""
    system, start = scene()[:2]
    plan = lm.Plan(system, method, 0.05, compiled=False)
    plain, run = (p.run(start, steps=3) for p in (plan, plan.replace(precision="double-double")))
    for name, x in plain.states.items():
        assert np.abs(x - run.states[name]).max() < 3e-15
    memory = build(run.carry.shape.layout, iter(np.ravel(run.carry.numbers).tolist()))
    memory = double_double(method.start(system, method.observe(memory), -0.05))
    for _ in range(3):
        memory = double_double(method.step(system, 0.0, memory, -0.05))
    end = method.observe(memory)
    words = np.array(leaves(end, layout_of(end))).reshape(-1, 2)
    begun = np.array(leaves(start, layout_of(start)))
    assert np.abs((words[:, 0] - begun) + words[:, 1]).max() < 1e-26


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_has_the_same_bits_and_keeps_the_structure() -> None:
    """Casimir, spatial momentum and orthogonality over 20,000 steps, from both words; resumed, and in an ensemble."""
    body, start = asymmetric_body()
    plan = lm.Plan(body, CAYLEY, 0.1, precision="double-double", every=50)
    plain, native = (plan.replace(compiled=c).run(start, steps=100) for c in (False, True))
    assert same_bits(plain.mu, native.mu)
    assert same_bits(plain.carry.numbers, native.carry.numbers)
    half = plan.replace(compiled=True).run(start, steps=50)
    assert same_bits(plan.replace(compiled=True).resume(half, steps=50).carry.numbers, native.carry.numbers)
    run = plan.replace(compiled=True, every=20_000).run(start, steps=20_000)
    casimir, space, unit = defects(run, start)
    assert max(casimir, space, unit) < 1e-28


def defects(run: Any, start: Any) -> tuple[float, float, float]:
    """How much of |mu|^2, of the momentum in space and of g g^T was lost, in exact arithmetic on both words."""
    words = [Fraction(x) for x in np.ravel(run.carry.numbers)[:24].tolist()]
    x = [words[i] + words[i + 1] for i in range(0, 24, 2)]
    mu, g = x[:3], [x[3 + 3 * i : 6 + 3 * i] for i in range(3)]
    mu0 = [Fraction(float(v)) for v in start.mu]
    g0 = [[Fraction(float(v)) for v in row] for row in np.asarray(start.g)]
    space, space0 = (
        [sum(a * b for a, b in zip(row, m, strict=True)) for row in m_g] for m_g, m in ((g, mu), (g0, mu0))
    )
    gram, gram0 = ([[sum(m[i][k] * m[j][k] for k in range(3)) for j in range(3)] for i in range(3)] for m in (g, g0))
    return (
        abs(float(sum(a * a for a in mu) / sum(a * a for a in mu0) - 1)),
        max(abs(float(a - b)) for a, b in zip(space, space0, strict=True)),
        max(abs(float(a - b)) for r, s in zip(gram, gram0, strict=True) for a, b in zip(r, s, strict=True)),
    )


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [EXP, CAYLEY, lm.LiePoissonHamiltonJacobi(4, lm.Cayley())], ids=named)
def test_a_million_steps_lose_nothing_of_the_structure(method: lm.Method) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.1, steps=10**6, every=10**6, precision="double-double")
    assert max(defects(run, start)) < 1e-27


@lm.record
class Drive(lm.LinearGroupEquation):
    """A velocity that is given, in doubles."""

    def drive(self, t: float) -> lm.Vec:
        return lm.vec(0.3, -0.7, 1.1)


@lm.record
class FromOutside(Drive):
    side = "right"


@lm.record
class Given(lm.Hamiltonian):
    """An energy whose gradient is given."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.3 * mu[0] - 0.7 * mu[1] + 1.1 * mu[2]


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    ("system", "method"),
    [
        (Drive(lm.SO3()), lm.Magnus(order=4)),
        (FromOutside(lm.SO3()), lm.RKMK(4)),
        (lm.LiePoissonSystem(lm.SO3(), Given()), lm.RKMK(4, retraction=lm.Cayley())),
        (Drive(lm.SO3()), lm.RKMK(4)),
        (Drive(lm.SO3()), lm.CommutatorFree(4)),
        (Drive(lm.SU(2)), lm.RKMK(4)),
        (Drive(lm.UnitQuaternions()), lm.RKMK(4)),
    ],
)
def test_a_velocity_that_is_given_keeps_the_structure(system: Any, method: lm.Method) -> None:
    """Orthogonal to rounding of what is recorded; steps of doubles are off by hundreds of it."""
    g = np.array(system.group.identity())
    free = isinstance(system, lm.LiePoissonSystem)
    start = system.state(mu=[0.1, 0.2, 0.3], g=g) if free else system.state(g)
    run = lm.integrate(system, method, start, h=0.1, steps=5000, every=5000, precision="double-double")
    assert system.group.defect(np.asarray(run.last.g)) <= 3.0 * 2.0**-52
    if free:
        assert np.linalg.norm(run.last.mu) == pytest.approx(np.linalg.norm([0.1, 0.2, 0.3]), rel=2e-16)


def test_what_has_16_digits_only_is_refused() -> None:
    body, start = asymmetric_body()
    with pytest.raises(InvalidType, match="power series"):
        lm.integrate(body, lm.Taylor(order=6), start, h=0.1, steps=2, precision="double-double", compiled=False)
    with pytest.raises(InvalidType, match="16 digits only; take Cayley"):
        lm.integrate(body, lm.ExactFreeBody(), start, h=0.1, steps=2, precision="double-double", compiled=False)


def test_choices_of_precision() -> None:
    body, start = asymmetric_body()
    with pytest.raises(InvalidInput, match="precision is 'double' or 'double-double'; got 'quad'"):
        lm.integrate(body, CAYLEY, start, h=0.1, steps=2, precision="quad")
    with pytest.raises(InvalidInput, match="need no compensated sums"):
        lm.integrate(body, CAYLEY, start, h=0.1, steps=2, precision="double-double", compensated=True)
    with pytest.raises(InvalidInput, match="fixed steps"):
        lm.integrate(body, lm.RKMK(order=5), start, t_end=1.0, precision="double-double")
    with pytest.raises(TypeError, match="two doubles cannot become a float"):
        float(DoubleDouble(1.0, 0.0))


@pytest.mark.parametrize(
    "base, n", [(-0.3, 2.0), (-0.3, 3.0), (-1.7, -2.0), (-1.1, 70), (-1.1, 65), (0.0, 2.0), (0.0, 0.5), (0.0, 0.0)]
)
def test_powers_of_negative_numbers_and_of_zero(base: float, n: float) -> None:
    """What they are to ordinary numbers, x^2.0 = x x, and not nan by a logarithm."""
    x = DoubleDouble(base, 1e-18 * base)
    with mp.workdps(60):
        want = mp.power(exactly(x), n)
        for got in (x**n, pow(x, n)):
            assert abs(exactly(got) - want) <= mp.mpf(2) ** -95 * abs(want)


@pytest.mark.parametrize("x", [-800.0, -400.0, 400.0, 1e6])
def test_hyperbolic_functions_far_out(x: float) -> None:
    assert exactly(tanh(DoubleDouble(x, 0.0))) == np.sign(x)
    if abs(x) < 700.0:
        with mp.workdps(60):
            assert abs(exactly(cosh(DoubleDouble(x, 0.0))) / mp.cosh(x) - 1) < mp.mpf(2) ** -90


@pytest.mark.slow
@pytest.mark.parametrize("order", [6, slow(8)])
def test_an_inexact_derivative_leaves_no_digits_behind(order: int) -> None:
    """Orders 6 and 8 solve by the derivative of order 4, off by a percent at large steps: the way
    back ends where it began.
    """
    body, start = asymmetric_body()
    method: Any = lm.LiePoissonHamiltonJacobi(order, lm.Cayley())
    state = double_double(body.state(start.mu))
    begun = np.array(leaves(state, layout_of(state))).reshape(-1, 2)
    for h in (0.8, -0.8):
        memory = method.step(body, 0.0, double_double(method.start(body, state, h)), h)
        state = double_double(method.observe(memory))
    words = np.array(leaves(state, layout_of(state))).reshape(-1, 2)
    assert np.abs((words - begun).sum(axis=1)).max() < 1e-28


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [lm.RKMK(order=2), slow(lm.LiePoissonHamiltonJacobi(6, lm.Cayley()))], ids=named)
def test_native_code_of_the_exponential_and_of_inexact_derivatives(method: lm.Method) -> None:
    """Both words have the same bits as in plain Python."""
    body, start = asymmetric_body()
    plan = lm.Plan(body, method, 0.4, precision="double-double")
    plain, native = (plan.replace(compiled=c).run(body.state(start.mu), steps=3) for c in (False, True))
    assert same_bits(plain.carry.numbers, native.carry.numbers)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "method", [lm.GalerkinVariational(order=2), lm.SymplecticRKMK(order=4), lm.RKMK(tableau=gauss(2))], ids=named
)
def test_native_code_of_stages_that_settle(method: lm.Method) -> None:
    """What tells whether stages have settled is a number in every sweep, of 16 digits."""
    system, start = heavy_top()[:2]
    plan = lm.Plan(system, method, 0.1, precision="double-double")
    plain, native = (plan.replace(compiled=c).run(start, steps=3) for c in (False, True))
    assert same_bits(plain.carry.numbers, native.carry.numbers)


@pytest.mark.parametrize("method", [lm.HamiltonJacobi(4), lm.SymmetricHamiltonJacobi(4)], ids=named)
def test_generating_functions_by_power_series_are_refused_in_plain_words(method: lm.Method) -> None:
    system = lm.models.Pendulum()
    with pytest.raises(InvalidType, match="power series have numbers of one double"):
        lm.integrate(system, method, system.state(0.3, 0.1), h=0.1, steps=2, precision="double-double", compiled=False)


@lm.record
class Kinked(lm.GroupEquation):
    """A velocity that holds a float on one way and a number of two doubles on the other."""

    def velocity(self, t: float, g: Any) -> Any:
        k = 0.1 if g[0, 1] > -0.05 else g[0, 1]
        return lm.vec(0.3 + k * k, 0.7, 1.1)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.xfail(reason="the float becomes a number of two doubles in native code: 0.1 * 0.1 in 31 digits")
def test_a_float_on_one_way_stays_a_float() -> None:
    equation = Kinked(lm.SO3())
    plan = lm.Plan(equation, lm.RKMK(order=4), 0.01, precision="double-double")
    start = equation.state(np.eye(3))
    plain, native = (plan.replace(compiled=c).run(start, steps=12) for c in (False, True))
    assert np.abs(plain.g - native.g).max() < 1e-15
    assert same_bits(plain.carry.numbers, native.carry.numbers)
