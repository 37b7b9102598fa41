"""Lie-Poisson Hamilton-Jacobi: the method itself to 13 digits, its order on several groups, and the structure it keeps."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from scenes import CAYLEY, asymmetric_body, named, poisson_defect, quiet_body, rotation, seed_body, slope, slow

import liemech as lm
from liemech import LiePoissonHamiltonJacobi
from liemech.integrators.motion_series import second_kind

# nested derivatives take minutes in plain Python; single runs compare its bits with native code
pytestmark = pytest.mark.compiled

EXP2, EXP4, EXP6, EXP8, CAYLEY2, CAYLEY4, CAYLEY6, CAYLEY8 = (
    LiePoissonHamiltonJacobi(order, retraction)
    for retraction in (lm.Exponential(), lm.Cayley())
    for order in (2, 4, 6, 8)
)
FOURTH = pytest.mark.parametrize("method", [EXP4, CAYLEY4], ids=named)
HIGHER = pytest.mark.parametrize("method", [EXP4, EXP6, CAYLEY4, CAYLEY6], ids=named)

# mu and g after n steps h = 0.5 of order 4, seed body: the method itself in 45-digit arithmetic,
# Newton to 1e-40
REFERENCE = {
    "Exponential": {
        1: (
            (0.47697586686960186, 0.2120757885648863, 0.8529465882038415),
            (
                (0.9750553227632007, -0.2023369176521582, 0.09125179070119209),
                (0.22162730817279525, 0.9100716970237275, -0.35021542305905595),
                (-0.01218416280387194, 0.3617033011065512, 0.9322136386823529),
            ),
        ),
        10: (
            (-0.46012707231330496, 0.27666975673690486, 0.8436450219325238),
            (
                (-0.9913727851994814, 0.1307571476932544, 0.009086753707870057),
                (-0.12447508620943097, -0.9609252223963948, 0.24724212803564438),
                (0.04106036627914756, 0.24397804263819256, 0.9689111213271621),
            ),
        ),
        200: (
            (0.22285297336913468, -0.6329157698411592, 0.7414540987457745),
            (
                (0.36320974791767263, -0.9077964200045507, -0.2097244354969207),
                (0.9304891928859956, 0.3649327940676615, 0.031842074937701345),
                (0.04762920259619242, -0.20671167272529894, 0.9772419062950379),
            ),
        ),
    },
    "Cayley": {
        1: (
            (0.47749856405144253, 0.20930711757238066, 0.8533379470422912),
            (
                (0.9754365996865275, -0.201285565845848, 0.08948497624798231),
                (0.21996404856046892, 0.9118071067351459, -0.34673277527249985),
                (-0.011800734420909616, 0.35789931697252375, 0.9336856117439789),
            ),
        ),
        10: (
            (-0.45443768881631014, 0.2943073970115797, 0.8407553407784925),
            (
                (-0.992950537284407, 0.1173131470789889, 0.016936824644279657),
                (-0.1081342669236557, -0.9550894607583422, 0.27588240658879026),
                (0.04854081605711983, 0.2721061327327308, 0.9610421643745639),
            ),
        ),
        200: (
            (-0.015659148933623718, -0.7053703590561788, 0.7086659633562429),
            (
                (0.6515579627566789, -0.757820830958841, -0.03434835270020987),
                (0.64809893179498, 0.532546832198507, 0.5443910782898093),
                (-0.3942587928944289, -0.376963472607343, 0.838128000096191),
            ),
        ),
    },
}


@lm.record
class Quartic(lm.Hamiltonian):
    """An energy that is not quadratic, of three momenta or more; its gradient is derived."""

    def energy(self, mu: lm.Vec) -> float:
        """sum_i mu_i^2/(2 + i/2) + mu_1 mu_2 mu_3/5 + mu_1^4/10."""
        total = 0.2 * mu[0] * mu[1] * mu[2] + 0.1 * mu[0] ** 4
        for i in range(len(mu)):
            total = total + mu[i] * mu[i] / (2.0 + 0.5 * i)
        return total


@lm.record
class TauOfCayley(lm.Retraction):
    """The Cayley map as a user writes it: nothing but its tau, so that every differential is derived."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        return group.cayley(xi)


@lm.record
class TiltAndSpin(lm.Retraction):
    """Half the tilt, the spin, half the tilt: a retraction of one's own that is nothing but its tau."""

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        tilt = group.cayley(lm.vec(0.5 * xi[0], 0.5 * xi[1], 0.0))
        return tilt @ group.cayley(lm.vec(0.0, 0.0, xi[2])) @ tilt


@lm.record
class Affine(lm.MatrixLieGroup):
    """Scalings and shifts of the plane, given by generators alone: four dimensions, not semisimple."""

    @property
    def generators(self) -> Any:
        """A scaling, a turn and two shifts."""
        return (
            ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)),
            ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
            ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
            ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
        )


def top() -> tuple[lm.models.ReducedHeavyTop, lm.BodyState]:
    """A heavy top on se(3)*, whose energy has no second derivative in half of its arguments."""
    system = lm.models.ReducedHeavyTop([1.0, 1.6, 2.3], 1.3, [0.1, 0.2, 1.0])
    attitude = rotation(np.random.default_rng(5))
    return system, system.from_top(
        lm.models.HeavyTop([1.0, 1.6, 2.3], 1.3, [0.1, 0.2, 1.0]).state(mu=[0.4, -0.5, 0.7], g=attitude)
    )


def quartic(group: lm.LieGroup, seed: int = 3) -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """The quartic energy on a group."""
    system = lm.LiePoissonSystem(group, Quartic())
    mu = np.random.default_rng(seed).normal(size=group.dim)
    return system, system.state(mu / np.linalg.norm(mu), np.array(group.identity()))


# ---------------------------------------------------------------- the method itself


@pytest.mark.sample(2)
@FOURTH
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_steps_of_the_method_itself(method: LiePoissonHamiltonJacobi, compiled: bool) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.5, steps=200 if compiled else 10, compiled=compiled)
    for n, (mu, g) in REFERENCE[type(method.retraction).__name__].items():
        if n > run.steps:
            continue  # two hundred steps in plain Python have the bits of native code
        assert np.abs(run.mu[n] - mu).max() < 1e-13
        assert np.abs(run.g[n] - g).max() < 1e-13


@pytest.mark.slow
def test_error_after_two_hundred_steps() -> None:
    body, start = seed_body()
    exact = body.exact(start, 100.0).mu
    for method, momentum, energy in ((EXP4, 2.5e-3, -2.3e-5), (CAYLEY4, 2.4e-1, -4.9e-4)):
        run = lm.integrate(body, method, start, h=0.5, steps=200)
        assert np.abs(run.mu[-1] - exact).max() == pytest.approx(momentum, rel=5e-2)
        assert run.energy[-1] - 3 / 8 == pytest.approx(energy, rel=5e-2)


@pytest.mark.slow
@pytest.mark.parametrize("group", [lm.SO3(), slow(lm.SE3()), slow(lm.SO(4))], ids=repr)
def test_order_two_is_the_variational_method_over_a_thousand_steps(group: lm.LieGroup) -> None:
    """With compensated sums, which leave the rounding of the increments alone, the runs do not part."""
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    mu = np.random.default_rng(1).normal(size=group.dim)
    start = system.state(mu / np.linalg.norm(mu), np.array(group.identity()))
    one, other = (
        lm.integrate(system, method, start, h=0.05, steps=1000, compensated=True) for method in (CAYLEY, CAYLEY2)
    )
    assert np.abs(one.mu - other.mu).max() < 1e-14
    assert np.abs(one.g - other.g).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
def test_order_two_is_the_variational_method(retraction: lm.Retraction) -> None:
    """s = h H: the displacement is h dH(p), p = dl(xi), and the equation for p is that of Algorithm
    1.
    """
    body, start = asymmetric_body()
    fish = lm.models.KirchhoffBody.of_blocks([1.0, 1.6, 2.3], [2.0, 2.5, 3.1])
    swim = fish.state([0.5, -0.3, 0.4, 0.2, 0.6, -0.4], np.eye(4))
    general = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy(np.diag([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])))
    turn = general.state([0.3, -0.5, 0.4, 0.2, 0.6, -0.3], np.eye(4))
    linear = lm.LiePoissonSystem(lm.MatrixLieGroup.of(lm.SL(2).generators), lm.KineticEnergy([1.0, 1.6, 2.3]))
    shear = linear.state([0.7, -0.5, 0.6], linear.group.exp([0.3, -0.2, 0.4]))
    scenes = [(body, start, 0.4), (fish, swim, 0.2), (linear, shear, 0.2), (general, turn, 0.2)]
    for system, state, h in scenes if retraction == lm.Cayley() else scenes[:3]:
        places = lm.integrate(
            system, lm.CovariantVariational(retraction), state, h=h, steps=100, every=5, compiled=False
        )
        everywhere = system.state(places.mu, places.g)
        ours, theirs = (
            lm.integrate(system, method, everywhere, h=h, steps=1, compiled=False)
            for method in (LiePoissonHamiltonJacobi(2, retraction), lm.CovariantVariational(retraction))
        )
        assert np.abs(ours.mu - theirs.mu).max() < 2e-15
        size = 1.0 + np.abs(places.g).max(axis=(1, 2))  # a fish is soon far away
        assert (np.abs(ours.g - theirs.g).max(axis=(0, 2, 3)) < 2e-15 * size).all()


@pytest.mark.parametrize(
    ("retraction", "group"),
    [
        (lm.Exponential(), lm.SO(4)),
        (lm.Cayley(), lm.SO3()),
        (lm.Cayley(), lm.SO(4)),
        (lm.CayleyAdjoint(), lm.SE3()),
        pytest.param(TiltAndSpin(), lm.SO3(), marks=pytest.mark.slow),
    ],
    ids=repr,
)
def test_second_term_is_the_second_time_derivative_of_the_energy(retraction: lm.Retraction, group: lm.LieGroup) -> None:
    """s_3 = (d/dt)^2 H((dtau^-1_tv)* p) at 0, left-trivialised, v = dH(p), and x = t v + (t^3/6)
    ds_3/dp; by differences.
    """
    system, start = quartic(group)
    p = np.array(start.mu)

    def energy(p: np.ndarray, t: float) -> float:
        v = np.array(system.velocity(p))
        return float(system.energy(retraction.dtau_inv_dual(group, t * v, p)))

    def third(p: np.ndarray) -> float:
        differences = [(energy(p, e) - 2.0 * energy(p, 0.0) + energy(p, -e)) / e**2 for e in (1e-2, 2e-2)]
        return (4.0 * differences[0] - differences[1]) / 3.0

    wanted = [(third(p + 1e-3 * unit) - third(p - 1e-3 * unit)) / 2e-3 for unit in np.eye(group.dim)]
    for terms in (2, 3):
        assert np.abs(6.0 * np.array(second_kind(system, retraction, start.mu, terms)[1]) - wanted).max() < 2e-5
    found = LiePoissonHamiltonJacobi(4, retraction).displacement(system, 1.0, start.mu)
    assert np.abs(6.0 * (np.array(found) - np.array(system.velocity(p))) - wanted).max() < 2e-5


def free_body_terms(K: np.ndarray, p: Any, cayley: bool) -> tuple[Any, Any]:
    """ds_3 and s_5 of a free body in closed form; ds_3 = (v x K w + K (K w x p))/2 [+ (p.v) K
    v + |v|^2 v], w = p x v, v = K p.
    """

    def times(x: Any) -> Any:
        return lm.vec(*[float(k) * c for k, c in zip(K, x)])

    cross, dot = lm.cross, lm.dot
    v = times(p)
    w = cross(p, v)
    u = 0.5 * (cross(v, times(w)) + times(cross(times(w), p)))
    if cayley:
        u = u + (dot(p, v) * times(v) + dot(v, v) * v)
    a1, a3 = -0.5 * cross(v, p), (-1.0 / 12.0) * cross(u, p)
    if cayley:
        a2, a4 = 0.25 * dot(v, p) * v, (1.0 / 24.0) * (dot(v, p) * u + dot(u, p) * v)
    else:
        a2 = (1.0 / 12.0) * cross(v, cross(v, p))
        a4 = (1.0 / 72.0) * (cross(u, cross(v, p)) + cross(v, cross(u, p)))
        a4 = a4 - (1.0 / 720.0) * cross(v, cross(v, cross(v, cross(v, p))))
    return u, 24.0 * (dot(v, a4) + dot(a1, times(a3)) + 0.5 * dot(a2, times(a2)))


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
def test_terms_of_a_free_body(retraction: lm.Retraction) -> None:
    """x_1 = v, x_3 = ds_3/6, x_5 = ds_5/120 with what the recursion for s gives on so(3)."""
    body, start = asymmetric_body()
    K, cayley = 1.0 / np.array(body.inertia), isinstance(retraction, lm.Cayley)
    p = lm.vec(*start.mu)
    found = second_kind(body, retraction, p, 3)
    third = free_body_terms(K, p, cayley)[0]
    fifth = lm.gradient(lambda q: free_body_terms(K, q, cayley)[1], p)
    for term, wanted in zip(found, (K * np.array(p), np.array(third) / 6.0, np.array(fifth) / 120.0)):
        assert np.abs(np.array(term) - wanted).max() < 1e-15


@pytest.mark.parametrize(
    ("retraction", "group"),
    [(lm.Exponential(), lm.SL(2)), slow(lm.Cayley(), lm.SO(4)), (lm.CayleyAdjoint(), lm.SE3())],
    ids=repr,
)
def test_displacements_are_gradients(retraction: lm.Retraction, group: lm.LieGroup) -> None:
    """x_k = ds_k/dp/k!: the derivative of x_3, of x_5 and of x_7 is symmetric, or the bracket would be lost."""
    system, start = quartic(group)
    p, e = np.array(start.mu), 1e-3

    def terms(q: np.ndarray) -> np.ndarray:
        return np.array([np.array(term) for term in second_kind(system, retraction, lm.vec(*q.tolist()), 4)])

    slopes = np.array([(terms(p + e * unit) - terms(p - e * unit)) / (2 * e) for unit in np.eye(group.dim)])
    for k in (1, 2, 3):
        hessian = slopes[:, k]
        assert np.abs(hessian - hessian.T).max() < 1e-5 * np.abs(hessian).max()


# ---------------------------------------------------------------- order and symmetry


MOTIONS = {"SO3": lambda: quartic(lm.SO3()), "top": top, "SE2": lambda: quartic(lm.SE2())}


@functools.cache
def end_of(name: str) -> lm.BodyState:
    """Where one of the motions is at t = 1."""
    system, start = MOTIONS[name]()
    return lm.integrate(system, lm.Taylor(12, lm.Exponential()), start, h=0.05, steps=20).last


@pytest.mark.slow
@HIGHER
@pytest.mark.parametrize("name", MOTIONS)
def test_order_of_other_motions(method: LiePoissonHamiltonJacobi, name: str) -> None:
    system, start = MOTIONS[name]()
    assert_order(system, method, start, end_of(name), (8, 16))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "group"),
    [
        (EXP6, lm.SL(2)),
        slow(EXP6, Affine()),
        slow(EXP2, lm.SO(4)),
        slow(EXP4, lm.SO(4)),
        slow(EXP6, lm.SO(4)),
        slow(CAYLEY6, lm.SO(4)),
        slow(EXP2, lm.SL(2)),
        slow(EXP4, lm.SL(2)),
        slow(CAYLEY6, lm.SL(2)),
        (EXP2, Affine()),
        slow(EXP4, Affine()),
        slow(EXP4, lm.SU(3)),
    ],
    ids=repr,
)
def test_order_on_groups_made_of_matrices(method: LiePoissonHamiltonJacobi, group: lm.LieGroup) -> None:
    system, start = quartic(group)
    reference = lm.integrate(system, lm.Taylor(12, lm.Exponential()), start, h=0.02, steps=50).last
    assert_order(system, method, start, reference, {2: (32, 64), 4: (16, 32), 6: (8, 16)}[method.order])


@pytest.mark.slow
def test_order_with_a_retraction_of_ones_own() -> None:
    body, start = asymmetric_body()
    assert_order(body, LiePoissonHamiltonJacobi(4, TiltAndSpin()), start, body.exact(start, 1.0), (5, 10))


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 6])
def test_derived_differentials_give_the_method_of_the_closed_forms(order: int) -> None:
    body, start = asymmetric_body()
    derived, closed = (
        lm.integrate(body, LiePoissonHamiltonJacobi(order, retraction), start, h=0.1, steps=10, compiled=True)
        for retraction in (TauOfCayley(), lm.Cayley())
    )
    for name in ("mu", "g"):
        assert np.abs(getattr(derived, name) - getattr(closed, name)).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize(("method", "counts"), [(EXP8, (6, 12)), slow(CAYLEY8, (16, 32))], ids=["exp", "Cayley"])
def test_order_eight(method: LiePoissonHamiltonJacobi, counts: tuple[int, int]) -> None:
    body, start = asymmetric_body()
    assert_order(body, method, start, body.exact(start, 3.0), counts, 3.0, 0.15)


def assert_order(
    system: Any,
    method: Any,
    start: lm.BodyState,
    end: Any,
    counts: tuple[int, ...],
    t_end: float = 1.0,
    abs: float = 0.1,
) -> None:
    """The error at the end falls as it should."""
    runs = [lm.integrate(system, method, start, h=t_end / n, steps=n) for n in counts]
    for name in ("mu", "g"):
        wanted = np.squeeze(np.array(getattr(end, name)))
        errors = [np.abs(getattr(run, name)[-1] - wanted).max() for run in runs]
        assert slope([1 / n for n in counts], errors) == pytest.approx(method.order, abs=abs)


# ---------------------------------------------------------------- structure


@pytest.mark.parametrize("method", [EXP2, EXP4, CAYLEY4, *(slow(m) for m in (EXP6, CAYLEY6))], ids=named)
def test_the_bracket_is_kept_by_an_energy_that_is_not_quadratic(method: LiePoissonHamiltonJacobi) -> None:
    system, start = quartic(lm.SO3())
    for h in (0.1, 0.5):
        assert poisson_defect(system, method, np.array(start.mu), h) < 1e-11


@pytest.mark.parametrize("method", [EXP2, EXP4], ids=named)
def test_the_bracket_of_a_heavy_top_is_kept(method: LiePoissonHamiltonJacobi) -> None:
    system, start = top()
    assert poisson_defect(system, method, np.array(start.mu), 0.3) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("method", [EXP4, CAYLEY4, EXP6, slow(CAYLEY6)], ids=named)
def test_energy_oscillates_and_momenta_are_kept(method: LiePoissonHamiltonJacobi) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.5, steps=10_000)
    error = np.abs(run.energy - run.energy[0])
    if method.order == 4:
        assert error[:1001].max() == pytest.approx({EXP4: 2.8e-5, CAYLEY4: 5.3e-4}[method], rel=0.1)
    assert error[5000:].max() <= 1.1 * error[:5000].max()
    assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 1e-13
    assert np.abs(np.linalg.norm(run.mu, axis=1) - 1.0).max() < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("method", [EXP4, EXP6], ids=named)
def test_casimirs_after_a_hundred_thousand_steps(method: LiePoissonHamiltonJacobi) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.1, steps=100_000, every=100, compiled=True)
    assert np.abs(np.linalg.norm(run.mu, axis=1) - 1.0).max() < 1e-13
    system, start = top()
    run = lm.integrate(system, method, start, h=0.1, steps=100_000, every=100, compiled=True)
    assert np.ptp(np.array(system.casimirs(run.mu)), axis=0).max() < 1e-13


# ---------------------------------------------------------------- running


@pytest.mark.parametrize("method", [EXP2, EXP4], ids=named)
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_too_large_a_step_is_refused(method: LiePoissonHamiltonJacobi, compiled: bool) -> None:
    body, start = quiet_body([2 / 3, 1.0, 2.0]), seed_body()[1]
    with pytest.raises(lm.errors.IntegrationFailure, match=r"h = 8 is too large.*try 2"):
        lm.integrate(body, method, start, h=8.0, steps=100, compiled=compiled)


def test_what_cannot_be_meant() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"order is one of \[2, 4, 6, 8\]; got 3"):
        LiePoissonHamiltonJacobi(3)
    with pytest.raises(lm.errors.InvalidType, match="retraction must be"):
        LiePoissonHamiltonJacobi(4, "exp")  # type: ignore[arg-type]
    system, start = quartic(lm.SU(3))
    with pytest.raises(lm.errors.IncompatibleSystem, match="Exponential"):
        lm.integrate(system, CAYLEY4, start, h=0.1, steps=1)
    heavy = lm.models.HeavyTop([1.0, 1.6, 2.3], 1.3, [0.1, 0.2, 1.0])
    with pytest.raises(lm.errors.IncompatibleSystem, match="hamiltonian"):
        lm.integrate(heavy, EXP4, heavy.state([0.4, -0.5, 0.7], np.eye(3)), h=0.1, steps=1)


# ---------------------------------------------------------------- Hamiltonians that cannot be used


@lm.record
class Arrays(lm.Hamiltonian):
    """An energy that leaves the language of formulas."""

    def energy(self, mu: lm.Vec) -> float:
        """|mu| by NumPy."""
        return float(np.linalg.norm(np.array(mu)))


@lm.record
class Doubled(lm.Hamiltonian):
    """An energy that is no number."""

    def energy(self, mu: lm.Vec) -> float:
        """2 mu."""
        return 2.0 * mu  # type: ignore[no-any-return]


@lm.record
class Halved(lm.Hamiltonian):
    """A gradient that is not that of the energy."""

    def energy(self, mu: lm.Vec) -> float:
        """|mu|^2."""
        return lm.dot(mu, mu)  # type: ignore[no-any-return]

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        """mu, where 2 mu is due."""
        return mu


@lm.record
class Kinked(lm.Hamiltonian):
    """An energy with a kink."""

    def energy(self, mu: lm.Vec) -> float:
        """That of a body, and |mu_1|/10."""
        return 0.5 * (mu[0] * mu[0] + mu[1] * mu[1] / 1.5 + mu[2] * mu[2] / 2.0) + 0.1 * abs(mu[0])


@pytest.mark.parametrize(
    ("hamiltonian", "error", "reason"),
    [
        (Arrays(), lm.errors.IncompatibleSystem, "Arrays does not bear it .* liemech.formulas"),
        (Doubled(), lm.errors.InvalidType, "Doubled.energy must return a number"),
        (Halved(), lm.errors.InvalidInput, "not the gradient of its energy.* Leave it out"),
    ],
    ids=["arrays", "doubled", "halved"],
)
def test_hamiltonians_that_cannot_be_differentiated(hamiltonian: lm.Hamiltonian, error: Any, reason: str) -> None:
    for order in (2, 4, 6):
        with pytest.raises(error, match=reason):
            system = lm.LiePoissonSystem(lm.SO3(), hamiltonian)
            lm.integrate(system, LiePoissonHamiltonJacobi(order), system.state([1.0, 2.0, 3.0]), h=0.1, steps=3)


@pytest.mark.slow
def test_a_kink_is_where_newton_stops() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Kinked())
    with pytest.raises(lm.errors.NoConvergence, match="H must be smooth"):
        lm.integrate(system, EXP4, system.state([0.1, 0.2, 1.0]), h=0.05, steps=2000, compiled=True)
