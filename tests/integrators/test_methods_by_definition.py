"""Formulas inside of methods, written down once more with NumPy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scenes import Oscillator, asymmetric_body, heavy_top, quiet_body, rotation

import liemech as lm
from liemech.formulas import vec
from liemech.integrators.discrete_lagrangian import GroupLagrangian, _body_velocity
from liemech.integrators.free_body import moser_veselov
from liemech.integrators.motion_series import _bernoulli
from liemech.rooms.hamilton_jacobi import class_functions, lie_poisson_hj
from liemech.rooms.hamilton_jacobi.class_functions import CayleySquare, InvariantForm, TraceOfAd

SO3, SE3, EXP, CAY = lm.SO3(), lm.SE3(), lm.Exponential(), lm.Cayley()


# ---------------------------------------------------------------- several time scales


@lm.record
class Sprung(lm.MultirateSystem):
    """A stiff spring of frequency 9 and a soft force."""

    degrees = 1
    parts = ("stiff", "soft")

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def stiff(self, q: lm.Vec) -> float:
        return 40.5 * q[0] * q[0]

    def soft(self, q: lm.Vec) -> float:
        return 0.1 * q[0] ** 4


@pytest.mark.parametrize("n", [1, 2, 5])
def test_the_mean_position_of_a_fast_motion(n: int) -> None:
    """From rest, leapfrog steps of length s are at q cos(k theta), 2 sin(theta/2) = s w; the mean
    is that of trapezoids.
    """
    h = 0.15 * n
    theta = 2.0 * np.arcsin(0.5 * 9.0 * h / n)
    at = np.cos(theta * np.arange(n + 1))
    mean = (at.sum() - 0.5 * (at[0] + at[-1])) / n
    method, system = lm.MultipleTimeSteps((n,), mollified=True), Sprung()
    assert method._mean(system, vec(0.7), h)[0] == pytest.approx(0.7 * mean, rel=1e-12)
    slow = 0.4 * (0.7 * mean) ** 3 * mean
    assert method._mollified(system, vec(0.7), h)[0] == pytest.approx(-slow, rel=1e-12)


def test_where_steps_are_told_to_be_unstable_or_resonant() -> None:
    """Unstable where h w reaches twice the number of fast steps; resonant where h w is within a
    tenth of pi of a multiple of pi.
    """
    system = Sprung()
    start = system.state([0.3], [0.2])

    def told(n: int, phase: float) -> str:
        return lm.MultipleTimeSteps((n,)).step_warning(system, start, phase / 9.0) or ""

    assert "unstable" in told(3, 6.001) and "unstable" not in told(3, 5.999)
    assert "7 or more" in told(3, 6.2)
    for multiple in (1, 2):
        for off, resonant in ((0.099, True), (-0.099, True), (0.101, False), (-0.101, False)):
            assert ("resonance" in told(20, np.pi * (multiple + off))) is resonant
    assert "h = 0.279" in told(20, np.pi)  # 0.8 pi/w
    assert not told(20, 0.05 * np.pi)
    many = system.state(np.full((9, 1), 0.3), np.zeros((9, 1)))
    assert "unstable" in lm.MultipleTimeSteps((3,)).step_warning(system, many, 6.2 / 9.0)


# ---------------------------------------------------------------- discrete Lagrangians


def test_the_action_of_a_bent_path() -> None:
    """h sum b_j l(v_j), v_j the body velocity of the path s -> tau(s h xi + s (1 - s) y)."""
    body, _ = asymmetric_body()
    xi, h, J = np.array([0.3, -0.5, 0.4]), 0.2, np.array(body.inertia)
    bend = -0.5 * h * h * np.cross(J * xi, xi) / J
    c, w = (np.polynomial.legendre.leggauss(3)[k] for k in (0, 1))
    for retraction, close in ((EXP, 1e-7), (CAY, 1e-9)):
        action = 0.0
        for s, weight in zip(0.5 + 0.5 * c, 0.5 * w):
            ends = [
                np.array(retraction.tau(SO3, vec(*(r * h * xi + r * (1.0 - r) * bend)))) for r in (s - 1e-4, s + 1e-4)
            ]
            v = np.array(SO3.log(ends[0].T @ ends[1])) / (2e-4 * h)
            action += 0.5 * h * weight * v @ (J * v)
        found = lm.QuadratureLagrangian(nodes=3).action(body, retraction, vec(*xi), h)
        assert found == pytest.approx(action, rel=close)


def test_the_velocity_of_a_path_is_cut_after_the_third_power() -> None:
    place, speed = vec(0.1, -0.05, 0.08), vec(0.3, 0.2, -0.6)
    whole = SO3.dexp(np.array(place), np.array(speed))
    off = np.array(_body_velocity(SO3, EXP, place, speed)) - whole
    ad = speed
    for _ in range(4):
        ad = SO3.ad(place, ad)
    assert np.abs(off + np.array(ad) / 120.0).max() < 1e-7 < np.abs(off).max()


def test_actions_on_elements() -> None:
    """L_d(g) as an action: its value, and its momentum by differences."""

    @lm.record
    class Traced(GroupLagrangian):
        def on_group(self, g: Any, h: float) -> float:
            return (1.3 * (3.0 - g[0, 0] - g[1, 1] - g[2, 2]) + 0.2 * (1.0 - g[2, 2])) / h

    body, _ = asymmetric_body()
    xi, h, lagrangian = np.array([0.3, -0.5, 0.4]), 0.2, Traced()
    for retraction in (EXP, CAY):

        def action(x: np.ndarray, retraction: Any = retraction) -> float:
            return lagrangian.action(body, retraction, vec(*x), h)

        g = retraction.tau(SO3, vec(*(h * xi)))
        assert action(xi) == pytest.approx(lagrangian.on_group(g, h), rel=1e-15)
        slopes = [(action(xi + 1e-5 * e) - action(xi - 1e-5 * e)) / 2e-5 / h for e in np.eye(3)]
        found = lagrangian.momentum(body, retraction, vec(*xi), h)
        assert np.allclose(found, slopes, rtol=1e-7)


def test_bernoulli_terms() -> None:
    """dexp^-1 from ad^first on to ad^last."""
    x, y = vec(0.3, -0.2, 0.5), vec(0.1, 0.4, -0.2)
    powers = [y]
    for _ in range(6):
        powers.append(SO3.ad(x, powers[-1]))
    numbers = [1.0, -1 / 2, 1 / 12, 0.0, -1 / 720, 0.0, 1 / 30240]
    for first, last in ((0, 6), (1, 4), (2, 6), (2, 5), (4, 4)):
        wanted = sum(numbers[k] * np.array(powers[k]) for k in range(first, last + 1))
        found = _bernoulli(lambda z: SO3.ad(x, z), powers[first], first, last)
        assert np.allclose(found, wanted, rtol=1e-13, atol=1e-16)


# ---------------------------------------------------------------- class functions


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("group", [SO3, SE3], ids=str)
def test_inverse_differentials_of_series(group: Any, far: bool) -> None:
    """Both forms of the coefficient: near zero, and beyond the reach of its series."""
    rng = np.random.default_rng(2)
    y, u = rng.normal(size=(2, group.dim))
    y[:3] *= (2.5 if far else 0.2) / np.linalg.norm(y[:3])
    for retraction in (EXP, lm.CayleyAdjoint()):
        found = class_functions.inverse_differential(group, retraction, vec(*y), vec(*u))
        wanted = retraction.dtau_inv(group, vec(*y), vec(*u))
        assert np.allclose(found, wanted, rtol=1e-13, atol=1e-14)


def test_how_far_class_functions_lead() -> None:
    """The size is the angle over the reach; of what does not turn the length; of nothing one."""
    mu = np.array([0.3, -0.4, 1.2])
    assert CayleySquare().size(SO3, CAY, vec(*mu)) == pytest.approx(1.3, rel=1e-14)
    assert InvariantForm().size(SO3, CAY, vec(*mu)) == pytest.approx(1.3, rel=1e-14)
    assert InvariantForm().size(SO3, EXP, vec(*mu)) == pytest.approx(1.3 / 3.0, rel=1e-14)
    assert TraceOfAd().size(SO3, EXP, vec(*mu)) == pytest.approx(1.3 / 0.5, rel=1e-13)
    assert InvariantForm().size(SO3, EXP, vec(0.0, 0.0, 0.0)) == 1.0
    # of screws: F^-1 swaps the halves
    long = vec(0.1, 0.2, 0.3, *mu)
    assert InvariantForm().size(SE3, EXP, long) == pytest.approx(1.3 / 3.0, rel=1e-13)
    straight = vec(*mu, 0.0, 0.0, 0.0)
    assert InvariantForm().size(SE3, EXP, straight) == pytest.approx(1.3 / 3.0, rel=1e-13)
    # on another group |ad_xi|/sqrt 2
    plane, xi = lm.SL(2), np.array([0.3, -0.4, 1.2])
    ad = np.array([plane.ad(vec(*xi), vec(*e)) for e in np.eye(3)])
    assert class_functions._turning(plane, vec(*xi)) == pytest.approx(np.sqrt(0.5 * (ad**2).sum()), rel=1e-14)


@pytest.mark.parametrize("group", [SO3, lm.SL(2), lm.SO(4)], ids=str)
def test_the_trace_of_the_adjoint(group: Any) -> None:
    """P_j = -tr(Ad_g ad_j)/k, and the xi with P = mu by Newton's method."""
    xi = 0.3 * np.cos(1.0 + np.arange(group.dim))
    Ad = np.array([group.Ad(group.exp(xi), e) for e in np.eye(group.dim)]).T
    ads = [np.array([group.ad(vec(*a), vec(*e)) for e in np.eye(group.dim)]).T for a in np.eye(group.dim)]
    k = max(np.abs(np.trace(a @ b)) for a in ads for b in ads)
    wanted = np.array([-np.trace(Ad @ a) for a in ads]) / k
    function = TraceOfAd()
    found = function.momentum(group, EXP, vec(*xi))
    assert np.allclose(found, wanted, rtol=1e-12, atol=1e-14)
    assert np.allclose(function.turn(group, EXP, found), xi, rtol=1e-12, atol=1e-13)
    first = np.array(function._first(group, found))
    assert np.abs(first - xi).max() < 0.3 * np.abs(xi).max()


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (np.diag([1.0, 1.0, 1.0 + 1e-9]), "is not invariant"),
        (np.diag([1.0, 1.0, 1.0 + 5e-11]), None),
        (np.diag([1.0, 1.0, 0.0]), "is degenerate, of rank 2"),
        (np.zeros((3, 3)), "is degenerate, of rank 0"),
        (np.eye(3) + 2e-12 * np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]]), "is not symmetric"),
        (np.eye(3) + 5e-13 * np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]]), None),
        (np.eye(2), "is of shape (2, 2), not (3, 3)"),
    ],
)
def test_forms_that_make_no_class_function(form: np.ndarray, words: str | None) -> None:
    found = class_functions._flaw(SO3, form)
    assert found is None if words is None else str(found).startswith(words)


def test_forms_on_other_charts() -> None:
    """F xi is the momentum of a class function where the chart agrees with Ad: Cayley's map on
    rotations, not on screws.
    """
    given = lm.Mat.of(np.array(SO3.algebra.invariant_form).tolist())
    assert class_functions._is_class_function(SO3, CAY, given)
    klein = lm.Mat.of(np.array(SE3.algebra.invariant_form).tolist())
    assert not class_functions._is_class_function(SE3, CAY, klein)
    assert class_functions._is_class_function(SE3, lm.CayleyAdjoint(), klein)
    rows = ((1.0, 2.0, 0.0), (0.0, 1.0, -3.0), (0.0, 0.0, 0.0))
    found = class_functions._times(rows, vec(0.5, 0.25, 2.0))
    assert tuple(found) == (1.0, -5.75, 0.0)


# ---------------------------------------------------------------- generating functions


def test_the_quick_ways_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Order 4 of a free body: no series; with principal moments a polynomial, no derivative."""
    for inertia in ([1.0, 1.6, 2.3], np.diag([1.0, 1.6, 2.3]) + 0.1):
        body = lm.RigidBody(inertia)
        method, p = lm.LiePoissonHamiltonJacobi(4, EXP), vec(0.4, -0.7, 0.9)
        slow = lie_poisson_hj.total(lie_poisson_hj.second_kind(body, EXP, p, 2, 0.3, 0.0))
        with monkeypatch.context() as patch:
            patch.setattr(lie_poisson_hj, "second_kind", None)
            if np.ndim(inertia) == 1:
                patch.setattr(lie_poisson_hj, "jacobian", None)
                patch.setattr(lie_poisson_hj, "derivative", None)
            x, slope = method.displacement(body, 0.3, p), np.array(method.slope(body, 0.3, p, 4))
            ends = [np.array(method.displacement(body, 0.3, p + s * vec(0.3, 0.2, 0.1))) for s in (1e-5, -1e-5)]
        assert np.allclose(x, slow, rtol=1e-13)
        assert np.allclose((ends[0] - ends[1]) / 2e-5, slope @ [0.3, 0.2, 0.1], rtol=1e-9)


# ---------------------------------------------------------------- exact steps


@pytest.mark.parametrize("unit", [1.0, 3.0, 2.0**-40])
def test_exact_steps_of_a_sphere(unit: float) -> None:
    body, mu = lm.RigidBody([2.0 * unit] * 3), unit * np.array([0.3, -0.7, 0.9])
    start = body.state(mu, rotation(np.random.default_rng(3)))
    method = lm.ExactMoserVeselov.of(body, start, 0.4)
    run = lm.integrate(body, method, start, h=0.4, steps=5, compiled=False)
    assert np.allclose(run.mu, mu, rtol=1e-13)
    assert np.allclose(run.g[-1], body.exact(start, 2.0).g, atol=1e-13)


@pytest.mark.parametrize("order", [2, 4])
def test_loads_are_undone_by_a_way_back(order: int) -> None:
    """The trapezoidal rule of a load is symmetric, in kicks at the ends and between drifts."""

    @lm.record
    class Braked(lm.Force):
        def covector(self, t: float, xi: lm.Vec, g: lm.Element) -> lm.Vec:
            return -(0.3 + 0.1 * t) * xi

    top, start = heavy_top(Braked())
    method, h = lm.KickDrift(order=order), 0.1
    there = method.step(top, 0.4, method.start(top, start, h), h)
    end = method.observe(there)
    back = method.observe(method.step(top, 0.4 + h, method.start(top, end, -h), -h))
    assert np.abs(np.array(back.mu) - np.array(start.mu)).max() < 1e-14
    assert np.abs(np.array(back.g) - np.array(start.g)).max() < 1e-14
    assert np.abs(np.array(end.mu) - np.array(start.mu)).max() > 1e-3


def test_a_force_is_carried_on_where_a_step_begins_with_a_kick() -> None:
    """And nothing where it begins with a drift: the memory has one shape from the start on."""
    top, start = heavy_top()
    seen = set()
    for name in lm.tableaus.__all__:
        tableau = getattr(lm.tableaus, name)
        if isinstance(tableau, lm.tableaus.SplittingTableau) and tableau.symmetric:
            method = lm.KickDrift(tableau=tableau)
            memory = method.start(top, start, 0.05)
            after = method.step(top, 0.0, memory, 0.05)
            kicks = tableau.kicks[0] != 0.0
            assert (memory.node is not None) == (after.node is not None) == kicks
            seen.add(kicks)
    assert seen == {True, False}


# ---------------------------------------------------------------- what is told of steps that fail


@pytest.mark.parametrize("unit", [1.0, 1000.0, 1e-5])
def test_where_a_solution_is_told_to_end(unit: float) -> None:
    """The same step in any unit of mass, less than the one asked for, and it is where the branch
    ends: a little less goes well.
    """
    body = quiet_body(unit * np.array([0.001, 1.0, 1.2]))
    mu, method = unit * np.array([0.3, 1.1, 0.4]), lm.CovariantVariational(EXP)
    with pytest.raises(lm.errors.NoConvergence) as error:
        method.displacement(body, 4.0, vec(*mu), 4.0 * body.velocity(vec(*mu)))
    end = float(re.search(r"ends at h = ([\d.e+-]+)", str(error.value))[1])  # type: ignore[index]
    usable = float(re.search(r"try ([\d.e+-]+)", str(error.value))[1])  # type: ignore[index]
    assert 0.0 < usable < end < 4.0
    short = 0.98 * end
    method.displacement(body, short, vec(*mu), short * body.velocity(vec(*mu)))
    assert usable == pytest.approx(method.largest_step(body, body.state(mu, np.eye(3))), rel=2e-2)


def test_where_no_bound_is_known_a_quarter_is_told() -> None:
    """Of rigid motions."""
    body, mu = (lm.models.KirchhoffBody([0.001, 1.0, 1.2, 1.0, 1.1, 1.3]), vec(0.3, 1.1, 0.4, 0.2, 0.5, 0.1))
    with pytest.raises(lm.errors.NoConvergence, match=r"ends at h = .* try 1$"):
        lm.CovariantVariational(EXP).displacement(body, 4.0, mu, 4.0 * body.velocity(mu))


def test_numbers_that_newtons_method_bears() -> None:
    """J/h between 2^-960 and 2^960 and J below 2^510 where J is constant; the third powers of J/h where it is not."""
    cases: list[tuple[Any, float, float, bool]] = []
    for power, fits in ((959.0, True), (961.0, False), (-959.0, True), (-961.0, False)):
        J = 2.0 ** (0.5 * power)
        cases.append((None, J, 2.0 ** (-0.5 * power), fits))
    cases += [(None, 2.0**509.5, 1.0, True), (None, 2.0**510.5, 1.0, False)]
    other = lm.QuadratureLagrangian()
    for power, fits in ((338.5, True), (339.5, False), (-335.5, True), (-336.5, False)):
        J = 2.0 ** (0.5 * power)
        cases.append((other, J, 2.0 ** (-0.5 * power), fits))
    for lagrangian, J, h, fits in cases:
        body = lm.RigidBody([J, J, J])
        method = lm.CovariantVariational(EXP, lagrangian)
        start = body.state([J, 0.0, 0.0], np.eye(3))
        if fits:
            method.step_warning(body, start, h)
        else:
            with pytest.raises(lm.errors.InvalidInput, match="leave the range of floats"):
                method.step_warning(body, start, h)


def test_moving_by_less_than_rounding_is_refused() -> None:
    """Where h |v| is below eps |q|, and the kick of the force over eps too."""
    ball = lm.SphericalPendulum(gravity=0.0)
    q, eps = [0.6, 0.0, -0.8], 2.0**-52
    for factor, refused in ((0.9, True), (1.1, False)):
        start = ball.state(q, [0.0, 0.5, 0.0])
        for method in (lm.RATTLE(), lm.LobattoPair(4)):
            h = factor * eps / 0.5
            if refused:
                with pytest.raises(lm.errors.InvalidInput, match="below the rounding of q"):
                    method.step_warning(ball, start, h)
            else:
                assert method.step_warning(ball, start, h) is None
    # at rest the kick h^2 g counts, over eps
    falling = lm.SphericalPendulum(gravity=1.0)
    rest = falling.state(q, [0.0, 0.0, 0.0])
    for factor, refused in ((0.9, True), (1.1, False)):
        h = factor * eps
        if refused:
            with pytest.raises(lm.errors.InvalidInput, match="below the rounding of q"):
                lm.RATTLE().step_warning(falling, rest, h)
        else:
            assert lm.RATTLE().step_warning(falling, rest, h) is None


def test_which_ends_of_a_step_are_on_the_branch() -> None:
    """By the angle between two normals of a sphere: refused beyond a quarter turn; near it, where
    the cosine is below 1/16, only if g is zero there; where it is below 2^-20, a dead point.
    """
    ball = lm.SphericalPendulum(gravity=1.0)
    q, p = vec(0.0, 0.0, -1.0), vec(0.5, 0.0, 0.0)
    G = ball.constraint_jacobian(q)
    pivots = vec(float(np.array(G)[0] @ np.array(G)[0]))

    def look(cosine: float, radius: float = 1.0) -> None:
        there = radius * vec(np.sqrt(1.0 - cosine * cosine), 0.0, -cosine)
        lm.RATTLE().check_branch(ball, 0.1, q, there, p, G, pivots)

    for cosine in (0.9, 0.07, 0.06, 2.0**-19):
        look(cosine)
    look(0.07, 1.0 + 1e-6)  # Newton's method has seen to that
    with pytest.raises(lm.errors.LiemechError, match="is left"):
        look(0.06, 1.0 + 1e-6)
    with pytest.raises(lm.errors.InconsistentState, match="a dead point"):
        look(2.0**-21)
    with pytest.raises(lm.errors.LiemechError, match="on another branch"):
        look(-0.5)


def test_steps_of_no_length() -> None:
    """The identity, h = 0, has no generating function of old and new positions."""
    for kind in ("qQ", "pP"):
        system = Oscillator(2.0)
        with pytest.raises(lm.errors.OutsideChart, match="the identity"):
            lm.HamiltonJacobi(2, kind=kind).solution(system, 0.0, 0.0, vec(0.3), vec(0.1))
    assert tuple(lm.HamiltonJacobi(2).solution(Oscillator(2.0), 0.0, 0.0, vec(0.3), vec(0.1))) == (0.0, 0.0)


# ---------------------------------------------------------------- what follows from an order


def test_how_many_terms_a_series_has_by_default() -> None:
    """q = p - 2 powers of ad; one less costs an order where Bernoulli's number is not zero."""
    for order in (1, 2, 3, 4, 5, 6, 8):
        method = lm.RKMK(order=order)
        assert method.truncation == max(order - 2, 0)
        assert repr(method) == f"RKMK(order={order})"
    assert lm.RKMK(order=4, retraction=CAY).truncation == "closed"
    for order, q, left in (
        (3, 0, 2),
        (4, 1, 3),
        (4, 0, 2),
        (6, 2, 5),
        (6, 3, 5),
        (8, 4, 7),
        (8, 5, 7),
        (5, 2, None),
        (4, 2, None),
        (6, 4, None),
        (2, 0, None),
    ):
        if left is None:
            lm.RKMK(order=order, truncation=q)
        else:
            words = f"of order {left}, not {order}; that takes {order - 2}"
            with pytest.warns(lm.errors.OrderWarning, match=words):
                lm.RKMK(order=order, truncation=q)


@pytest.mark.parametrize("retraction", [EXP, CAY], ids=repr)
@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_one_step_errs_by_the_next_power(order: int, retraction: Any) -> None:
    """Of methods of Lie-Poisson and Hamilton and Jacobi, in momentum and attitude."""
    body, start = asymmetric_body()
    method, errors = lm.LiePoissonHamiltonJacobi(order, retraction), []
    for h in (0.3, 0.15) if order > 4 else (0.1, 0.05):
        end = method.observe(method.step(body, 0.0, method.start(body, start, h), h))
        exact = body.exact(start, h)
        errors.append([np.abs(np.array(end.mu) - exact.mu).max(), np.abs(np.array(end.g) - exact.g).max()])
    slopes = np.log2(np.array(errors[0]) / errors[1])
    assert np.abs(slopes - (order + 1)).max() < 0.6


# ---------------------------------------------------------------- units, parts, borders


@pytest.mark.parametrize("h", [1e-5, 0.05, -1e-3])
@pytest.mark.parametrize("kind", ["qP", "qQ", "pP"])
@pytest.mark.parametrize("adjoint", [False, True])
def test_generating_functions_in_short_steps(kind: str, adjoint: bool, h: float) -> None:
    """Order 2, and the other kind of step backwards undoes it."""
    system, method = Oscillator(2.0), lm.HamiltonJacobi(2, adjoint, kind)
    start = system.state([0.3], [0.4])
    end = method.step(system, 0.0, start, h)
    other = lm.HamiltonJacobi(2, not adjoint, kind)
    back = other.step(system, 0.0, end, -h)
    assert abs(back.q[0] - 0.3) < 1e-14 and abs(back.p[0] - 0.4) < 1e-14
    c, s = np.cos(2.0 * h), np.sin(2.0 * h)
    assert abs(end.q[0] - (0.3 * c + 0.2 * s)) < 2.0 * abs(h) ** 3 + 1e-15
    assert abs(end.p[0] - (0.4 * c - 0.6 * s)) < 4.0 * abs(h) ** 3 + 1e-15


@pytest.mark.parametrize("h", [0.05, 0.6, 1.2, 2.4])
def test_displacements_of_exact_steps_in_parts(h: float) -> None:
    """cay(x) is the rotation of the whole step, of one part, of two and of four."""
    body, start = asymmetric_body()
    method = lm.ExactFreeBody()
    parts = method._cut(body.hamiltonian.inverse, start.mu, h)[1]
    assert parts == {0.05: 1.0, 0.6: 1.0, 1.2: 2.0, 2.4: 4.0}[h]
    x = moser_veselov._exact_displacement(body.hamiltonian.inverse, start.mu, h)
    turn = np.array(start.g).T @ np.array(body.exact(start, h).g)
    assert np.abs(np.array(SO3.cayley(np.array(x))) - turn).max() < 1e-14
    around = moser_veselov._exact_displacement(vec(1.0, 1.0, 1.0), vec(0.0, 0.0, 1.0), 4.0)
    assert np.isnan(np.array(around)).all()


def test_which_bodies_fly_straight() -> None:
    """A mass that is the same along all axes, and none of the momentum in the turning part."""
    method, coupled = lm.ExactFreeBody(), np.diag([1.0, 1.5, 2.0, 3.0, 3.0, 3.0])
    coupled[0, 4] = coupled[4, 0] = 0.1
    for inertia, straight in (
        ([1.0, 1.5, 2.0, 3.0, 3.0, 3.0], True),
        (np.diag([1.0, 1.5, 2.0, 3.0, 3.0, 3.0]) + np.pad(0.1 * np.ones((3, 3)), (0, 3)), True),
        ([1.0, 1.5, 2.0, 3.0, 3.0, 3.1], False),
        (np.diag([1.0, 1.5, 2.0, 3.0, 3.1, 3.0]), False),
        (coupled, False),
    ):
        if straight:
            method.require(lm.models.KirchhoffBody(inertia))
        else:
            with pytest.raises(lm.errors.IncompatibleSystem, match="does not fly straight on"):
                method.require(lm.models.KirchhoffBody(inertia))
    apart = lm.ProductGroup(SO3, lm.VectorSpace(3))
    method.require(lm.LiePoissonSystem(apart, lm.KineticEnergy([1.0, 1.5, 2.0, 3.0, 3.1, 3.2])))


def test_frequencies_of_several_fast_parts() -> None:
    """All parts but the slowest count together."""

    @lm.record
    class Two(Sprung):
        parts = ("stiff", "soft", "slow")

        def soft(self, q: lm.Vec) -> float:
            return 20.0 * q[0] * q[0]

        def slow(self, q: lm.Vec) -> float:
            return 0.5 * q[0] * q[0]

    system = Two()
    method, start = lm.MultipleTimeSteps((1, 2)), system.state([0.3], [0.2])
    for phase, told in ((3.99, False), (4.01, True)):
        warning = method.step_warning(system, start, phase / 11.0) or ""
        assert ("unstable" in warning) is told


SCALED = [
    lm.RKMK(tableau=lm.tableaus.gauss(2)),
    lm.Isospectral(4),
    lm.GalerkinVariational(4),
    lm.MoserVeselov(),
    lm.ImplicitMidpoint(),
    lm.SphericalMidpoint(),
    lm.LiePoissonHamiltonJacobi(4),
    lm.CovariantVariational(EXP),
]


@pytest.mark.parametrize("method", SCALED, ids=lambda method: method.name)
@pytest.mark.parametrize("power", [-60, 60])
def test_a_slow_body_steps_like_a_fast_one(method: Any, power: int) -> None:
    """A unit of time changes no bit: no number but zero is small by itself."""
    body, start = asymmetric_body()
    unit = 2.0**power
    slow = body.state(unit * np.array(start.mu), start.g)
    one, other = method.start(body, start, 0.3), method.start(body, slow, 0.3 / unit)
    for _ in range(2):
        one, other = method.step(body, 0.0, one, 0.3), method.step(body, 0.0, other, 0.3 / unit)
    ends = method.observe(one), method.observe(other)
    assert np.array_equal(unit * np.array(ends[0].mu), np.array(ends[1].mu))
    assert np.array_equal(np.array(ends[0].g), np.array(ends[1].g))


@pytest.mark.parametrize(
    "method", [lm.HamiltonJacobi(4), lm.HamiltonJacobi(4, True), lm.HamiltonJacobi(3, kind="qQ")], ids=repr
)
@pytest.mark.parametrize("power", [-60, 60])
def test_small_swings_are_like_large_ones(method: Any, power: int) -> None:
    """A linear oscillator in any unit of length, bit for bit."""
    system, unit, h = Oscillator(2.0), 2.0**power, 0.2
    start = system.state([0.3], [0.4]), system.state([0.3 * unit], [0.4 * unit])
    one, other = (method.step(system, 0.0, method.start(system, s, h), h) for s in start)
    ends = method.observe(one), method.observe(other)
    assert unit * ends[0].q[0] == ends[1].q[0] and unit * ends[0].p[0] == ends[1].p[0]


# ---------------------------------------------------------------- what is told to try


def too_far() -> list[Any]:
    body, start = asymmetric_body()
    sphere, species = lm.SphericalPendulum(), lm.models.LotkaVolterra()
    swinging, some = sphere.state([0.6, 0.0, -0.8], [0.4, 0.9, 0.3]), species.state([1.3, 0.6])
    return [
        *((method, body, start) for method in FREE),
        *((method, sphere, swinging) for method in (lm.RATTLE(), lm.LobattoPair(4))),
        *((method, species, some) for method in (lm.PoissonEuler(), lm.PoissonVerlet())),
        (lm.HamiltonJacobi(4), lm.models.Pendulum(), lm.models.Pendulum().state([2.0], [0.1])),
    ]


FREE = (
    lm.MoserVeselov(),
    lm.SphericalMidpoint(),
    lm.Isospectral(4),
    lm.GalerkinVariational(4),
    lm.LiePoissonHamiltonJacobi(4),
    lm.FirstKindHamiltonJacobi(2),
    lm.RKMK(tableau=lm.tableaus.gauss(2)),
)


@pytest.mark.parametrize("case", range(12))
def test_a_step_that_is_too_large_is_told_a_quarter(case: int) -> None:
    method, system, start = too_far()[case]
    told = None
    for h in (5.0, 40.0):
        try:
            memory = method.start(system, start, h)
            for _ in range(3):
                memory = method.step(system, 0.0, memory, h)
        except lm.errors.LiemechError as error:
            told = re.search(r"[Tt]ry (?:h = )?([\d.e+-]+\d)", str(error))
            break
    half = isinstance(method, lm.PoissonVerlet)  # each of its halves is a step
    assert told and float(told[1]) == pytest.approx(0.25 * h / (1 + half), rel=1e-5)
