"""Hamilton-Jacobi methods of the first kind: closed forms and digits from elsewhere, orders,
structure, and what is refused.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body, poisson_defect, seed_body, slope, slow

import liemech as lm
from liemech.groups.lie_algebra import sided
from liemech.integrators.motion_series import first_kind
from liemech.rooms.hamilton_jacobi.class_functions import CayleySquare, ClassFunction, InvariantForm, TraceOfAd
from liemech.rooms.hamilton_jacobi.lie_poisson_first_kind import FirstKindHamiltonJacobi

pytestmark = pytest.mark.compiled

EXP, CAYLEY, ADJOINT = lm.Exponential(), lm.Cayley(), lm.CayleyAdjoint()
FORM, TRACE, SQUARE = InvariantForm(), TraceOfAd(), CayleySquare()
KLEIN = InvariantForm(np.roll(np.eye(6), 3, axis=0))

PAIRS = (FORM, EXP), (FORM, CAYLEY), (TRACE, EXP), (SQUARE, CAYLEY)
ON_SO3 = pytest.mark.parametrize(("s0", "retraction"), PAIRS, ids=str)
QUICK = (4, FORM, EXP), (3, FORM, CAYLEY), (2, SQUARE, CAYLEY)
"""Orders that are measured whenever the tests run; the others are slow."""

# one step h = 0.05 of the article's body from its start, exp, S_0 = |xi|^2/2, in 45-digit
# arithmetic: xi, mu, g exp(-mu)
STEPS = {
    1: (
        (0.5384356453026714, 0.012586258919903209, 0.8892667310061662),
        (0.4997201864668675, 0.02394064530777511, 0.8658559815233515),
        (
            (0.9997545622220033, -0.02212817512508107, 0.0010766531122840643),
            (0.02215360944227434, 0.9989377201647112, -0.04040604930958118),
            (-0.00018139727015821063, 0.04041998389117536, 0.9991827620597082),
        ),
    ),
    2: (
        (0.5355062818193469, 0.011256562700557873, 0.8886505695663407),
        (0.49976871466408807, 0.021465287935652014, 0.8658928763171833),
        (
            (0.9997655939786587, -0.02163044389649184, 0.0009386124549009786),
            (0.02165039822875936, 0.9990709428292308, -0.03726273541821629),
            (-0.00013173092237563262, 0.0372743221420937, 0.9993050623087084),
        ),
    ),
}


@lm.record
class Quartic(lm.Hamiltonian):
    """An energy that is not quadratic; its gradient is derived."""

    def energy(self, mu: lm.Vec) -> float:
        """sum_i mu_i^2/(2 + i/2) + mu_1 mu_2 mu_3/5 + mu_1^4/10."""
        square = mu[0] * mu[0]
        total = 0.2 * mu[0] * mu[1] * mu[2] + 0.1 * (square * square)
        for i in range(len(mu)):
            total = total + mu[i] * mu[i] / (2.0 + 0.5 * i)
        return total


def fish() -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """A body in a fluid, on se(3)*."""
    system = lm.models.KirchhoffBody.of_blocks([1.0, 1.6, 2.3], [2.0, 2.5, 3.1])
    return system, system.state([0.5, -0.3, 0.4, 0.2, 0.6, -0.4], np.eye(4))


def top() -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """A heavy top on se(3)*, whose energy is linear in half of the momenta."""
    system = lm.models.ReducedHeavyTop([1.0, 1.6, 2.3], 1.3, [0.1, 0.2, 1.0])
    return system, system.state([0.4, -0.5, 0.7, 0.6, 0.0, 0.8], np.eye(4))


def on(group: lm.LieGroup) -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """The quartic energy on a group."""
    system = lm.LiePoissonSystem(group, Quartic())
    mu = np.random.default_rng(3).normal(size=group.dim)
    return system, system.state(mu / np.linalg.norm(mu), np.array(group.identity()))


# ---------------------------------------------------------------- the method itself


@pytest.mark.parametrize("order", [1, 2])
def test_a_step_to_thirteen_digits(order: int) -> None:
    body, start = seed_body()
    method = FirstKindHamiltonJacobi(order, scale=1.0)
    run = lm.integrate(body, method, start, h=0.05, steps=1)
    xi, mu, g = STEPS[order]
    found = method.displacement(body, 0.05, lm.vec(*start.mu), 1.0, lm.vec(*start.mu))
    assert np.abs(np.array(found) - xi).max() < 1e-13
    assert np.abs(run.mu[1] - mu).max() < 1e-13
    assert np.abs(run.g[1] - g).max() < 1e-13


K = 1.0 / np.array([1.0, 1.6, 2.3])
XI = lm.vec(0.5, -0.7, 0.4)


def exponential_terms(xi: Any) -> list[Any]:
    """S_1, S_2 for S_0 = |xi|^2/2: -xi.v/2 and |v|^2 - d |w|^2 with v = K xi, w = xi x v."""
    theta = lm.norm(xi)
    half = 0.5 * theta
    d = (1.0 - half * lm.formulas.cos(half) / lm.formulas.sin(half)) / (theta * theta)
    v = lm.vec(*[k * x for k, x in zip(K, xi)])
    w = lm.cross(xi, v)
    return [-0.5 * lm.dot(xi, v), lm.dot(v, v) - d * lm.dot(w, w)]


def cayley_terms(xi: Any) -> list[Any]:
    """S_1 to S_4 for the Cayley map and S_0 = 2 c log(1 + |xi|^2/4), with c = 1."""
    v, u, z = (lm.vec(*[k**n * x for k, x in zip(K, xi)]) for n in (1, 2, 3))
    a, b, e, f, w = lm.dot(xi, v), lm.dot(v, v), lm.dot(xi, z), lm.dot(u, u), lm.cross(xi, v)
    kw, kkw = (lm.dot(w, lm.vec(*[k**n * x for k, x in zip(K, w)])) for n in (1, 2))
    return [
        -0.5 * a,
        b + 0.25 * a * a,
        -(3.0 * e + 2.0 * a * b + 5.0 / 16.0 * a**3 + 0.25 * kw),
        12.0 * f
        + 5.5 * b * b
        + 10.0 * a * e
        + 5.75 * a * a * b
        + 21.0 / 32.0 * a**4
        + (a + 2.0 * float(K.sum())) * kw
        - 2.0 * kkw,
    ]


@pytest.mark.parametrize(
    ("retraction", "terms"), [(EXP, exponential_terms), (CAYLEY, cayley_terms)], ids=["exp", "Cayley"]
)
def test_closed_forms_on_so3(retraction: lm.Retraction, terms: Callable[[Any], list[Any]]) -> None:
    """pi_k = (dtau^-1_xi)* dS_k/dxi / k!."""
    body, _ = asymmetric_body()
    count = len(terms(XI))
    found = first_kind(body, retraction, FORM, 1.0, XI, count)
    for k in range(1, count + 1):
        slope_of_s = lm.gradient(lambda x, k=k: terms(x)[k - 1], XI)
        wanted = np.array(retraction.dtau_inv_dual(lm.SO3(), XI, slope_of_s)) / np.prod(np.arange(1.0, k + 1.0))
        assert np.abs(np.array(found[k]) - wanted).max() < 1e-13


@pytest.mark.parametrize(
    ("s0", "retraction", "group", "value"),
    [
        (FORM, EXP, lm.SO3(), lambda x: 0.5 * lm.dot(x, x)),
        (FORM, CAYLEY, lm.SO3(), lambda x: 2.0 * lm.formulas.log(1.0 + 0.25 * lm.dot(x, x))),
        (SQUARE, CAYLEY, lm.SO3(), lambda x: 0.5 * lm.dot(x, x)),
        (TRACE, EXP, lm.SO3(), lambda x: -lm.formulas.cos(lm.norm(x))),
        (KLEIN, EXP, lm.SE3(), lambda x: x[0] * x[3] + x[1] * x[4] + x[2] * x[5]),
    ],
    ids=["exp", "log", "square", "trace", "Klein"],
)
def test_class_functions(
    s0: ClassFunction, retraction: lm.Retraction, group: lm.LieGroup, value: Callable[[Any], Any]
) -> None:
    """Their momentum is one for the body and for space, and its inverse gives the displacement back."""
    xi = lm.vec(*[0.4 * np.cos(1.0 + 2.0 * k) for k in range(group.dim)])
    momentum = np.array(s0.momentum(group, retraction, xi))
    for side in ("left", "right"):
        carried = retraction.dtau_inv_dual(group, sided(xi, side), lm.gradient(value, xi))
        assert np.abs(np.array(carried) - momentum).max() < 1e-14
    assert np.abs(np.array(s0.turn(group, retraction, lm.vec(*momentum))) - np.array(xi)).max() < 1e-14


@pytest.mark.slow
def test_the_trace_is_the_same_function_for_every_retraction() -> None:
    body, start = asymmetric_body()
    methods = (FirstKindHamiltonJacobi(3, r, TRACE) for r in (EXP, CAYLEY))
    runs = [lm.integrate(body, method, start, h=0.05, steps=10, compiled=False) for method in methods]
    assert np.abs(runs[0].mu - runs[1].mu).max() < 1e-13
    assert np.abs(runs[0].g - runs[1].g).max() < 1e-13


# ---------------------------------------------------------------- order


@pytest.mark.parametrize(
    ("order", "s0", "retraction"),
    [case if case in QUICK else slow(*case) for case in ((order, *pair) for order in (1, 2, 3, 4) for pair in PAIRS)],
    ids=str,
)
def test_order_on_so3(order: int, s0: ClassFunction, retraction: lm.Retraction) -> None:
    body, start = asymmetric_body()
    assert_order(body, FirstKindHamiltonJacobi(order, retraction, s0), start, body.exact(start, 1.0), (80, 160))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "retraction", "scene"),
    [
        (2, EXP, top),
        *(
            slow(order, retraction, scene)
            for order in (1, 2, 3, 4)
            for retraction in (EXP, ADJOINT)
            for scene in (fish, top)
            if (order, retraction, scene) != (2, EXP, top)
        ),
    ],
)
def test_order_with_the_klein_form(order: int, retraction: lm.Retraction, scene: Callable[[], Any]) -> None:
    system, start = scene()
    assert_order(system, FirstKindHamiltonJacobi(order, retraction, KLEIN), start, end_of(scene))


@functools.cache
def end_of(scene: Callable[[], Any]) -> lm.BodyState:
    """Where a scene is at t = 1."""
    system, start = scene()
    return lm.integrate(system, lm.Taylor(12, EXP), start, h=0.05, steps=20).last


@pytest.mark.slow
@pytest.mark.parametrize("order", [slow(2), 4])
def test_order_of_a_quartic_energy(order: int) -> None:
    system, start = on(lm.SO3())
    assert_order(system, FirstKindHamiltonJacobi(order), start)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 4])
def test_order_on_so4(order: int) -> None:
    system, start = on(lm.SO(4))
    end = lm.integrate(system, lm.Taylor(12, EXP), start, h=0.02, steps=10).last
    for s0 in (FORM, TRACE):  # in plain Python: TRACE, derived twice, is too long for native code
        assert_order(system, FirstKindHamiltonJacobi(order, CAYLEY, s0), start, end, (12, 24), 0.2, compiled=False)


def assert_order(
    system: Any,
    method: lm.Method,
    start: lm.BodyState,
    end: Any = None,
    counts: tuple[int, ...] = (40, 80),
    t_end: float = 1.0,
    compiled: bool = True,
) -> None:
    """The error at the end, of momentum and of attitude, falls as it should."""
    end = end or lm.integrate(system, lm.Taylor(12, EXP), start, h=0.02, steps=50).last
    runs = [lm.integrate(system, method, start, h=t_end / n, steps=n, compiled=compiled) for n in counts]
    for name in ("mu", "g"):
        errors = [np.abs(getattr(run, name)[-1] - np.squeeze(np.array(getattr(end, name)))).max() for run in runs]
        assert slope([1 / n for n in counts], errors) == pytest.approx(method.order, abs=0.2)  # type: ignore[attr-defined]


# ---------------------------------------------------------------- structure


@pytest.mark.slow
@ON_SO3
def test_what_a_body_keeps(s0: ClassFunction, retraction: lm.Retraction) -> None:
    body, start = asymmetric_body()
    method = FirstKindHamiltonJacobi(2, retraction, s0)
    run = lm.integrate(body, method, start, h=0.02, steps=10_000, every=10)
    energy = np.abs(run.energy - run.energy[0])
    assert energy[500:].max() <= 1.1 * energy[:500].max()
    assert np.abs(np.linalg.norm(run.mu, axis=1) - 1.3).max() < 1e-13
    assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 2e-13


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "s0", "retraction"),
    [
        (asymmetric_body, FORM, EXP),
        (asymmetric_body, SQUARE, CAYLEY),
        slow(asymmetric_body, TRACE, CAYLEY),
        slow(fish, KLEIN, EXP),
        slow(fish, KLEIN, ADJOINT),
    ],
    ids=lambda x: getattr(x, "__name__", type(x).__name__),
)
def test_the_bracket_is_kept(scene: Callable[[], Any], s0: ClassFunction, retraction: lm.Retraction) -> None:
    system, start = scene()
    method = FirstKindHamiltonJacobi(2, retraction, s0, scale=2.6)
    assert poisson_defect(system, method, np.array(start.mu), 0.05) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("retraction", [ADJOINT, slow(EXP)], ids=repr)
def test_what_a_fish_keeps(retraction: lm.Retraction) -> None:
    system, start = fish()
    run = lm.integrate(system, FirstKindHamiltonJacobi(4, retraction), start, h=0.02, steps=3000, every=10)
    casimirs = np.array(system.casimirs(run.mu))
    assert np.ptp(casimirs, axis=0).max() < 1e-13


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("compiled", [False, slow(True)])
def test_momenta_outside_the_chart(compiled: bool) -> None:
    body, start = asymmetric_body()
    for s0, scale in ((FORM, 0.2), (TRACE, 1.2)):
        with pytest.raises(lm.errors.OutsideChart, match="Take a larger scale; None chooses one"):
            lm.integrate(body, FirstKindHamiltonJacobi(2, EXP, s0, scale), start, h=0.05, steps=3, compiled=compiled)


def test_forms_that_generate_no_identity() -> None:
    algebra = lm.SE3().algebra
    cases: list[tuple[lm.LieGroup, ClassFunction, str]] = [
        (
            lm.Heisenberg(),
            FORM,
            "no regular invariant form. LiePoissonHamiltonJacobi, of the second kind, serves every group",
        ),
        (lm.Heisenberg(), InvariantForm(np.eye(3)), "the form is not invariant"),
        (lm.SE3(), InvariantForm(algebra.killing_form), "is degenerate, of rank 3"),
        (lm.SE3(), TRACE, "the Killing form .* is degenerate.* InvariantForm"),
        (lm.SE3(), SQUARE, "SO3.* with Cayley"),
        (lm.SO3(), InvariantForm(np.eye(4)), r"is of shape \(4, 4\), not \(3, 3\)"),
        (lm.SO3(), InvariantForm(np.triu(np.ones((3, 3)))), "is not symmetric"),
    ]
    for group, s0, reason in cases:
        system, start = on(group)
        with pytest.raises(lm.errors.IncompatibleSystem, match=reason):
            lm.integrate(system, FirstKindHamiltonJacobi(2, EXP, s0), start, h=0.1, steps=1)


def test_retractions_of_which_it_is_no_class_function() -> None:
    system, start = fish()
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"no class function\. On SE3.* take"):
        lm.integrate(system, FirstKindHamiltonJacobi(2, CAYLEY), start, h=0.1, steps=1)
    system, start = on(lm.SO(4))
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"take Cayley\(\)"):
        lm.integrate(system, FirstKindHamiltonJacobi(2), start, h=0.1, steps=1)


def test_what_cannot_be_meant() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"order is one of \[1, 2, 3, 4\]; got 5"):
        FirstKindHamiltonJacobi(5)
    with pytest.raises(lm.errors.InvalidType, match="s0 must be"):
        FirstKindHamiltonJacobi(2, s0="trace")  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidInput, match="scale must be a positive number"):
        FirstKindHamiltonJacobi(2, scale=-1.0)
    with pytest.raises(lm.errors.InvalidInput, match="square matrix"):
        InvariantForm("Klein")  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidInput, match="not symmetric"):
        lm.Composition(FirstKindHamiltonJacobi(2))
    body, start = asymmetric_body()
    with pytest.raises(lm.errors.NoConvergence, match="h = 8 is too large"):
        lm.integrate(body, FirstKindHamiltonJacobi(2), start, h=8.0, steps=3)
