"""Algorithm 1 with discrete Lagrangians other than h l(xi): equivalences, orders, and what every one of them keeps."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, NotDefined
from liemech.formulas import Mat, Vec, dot, record

BODY, START = asymmetric_body()
J = BODY.inertia
RETRACTIONS = pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)


@record
class Trace(lm.GroupLagrangian):
    """L_d(g) = tr((1 - g) J_d)/h, J_d = tr(J)/2 - J: the discrete Lagrangian of Moser and Veselov."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    moments: Vec

    def on_group(self, g: Mat, h: float) -> float:
        J = self.moments
        half = 0.5 * (J[0] + J[1] + J[2])
        return ((half - J[0]) * (1.0 - g[0, 0]) + (half - J[1]) * (1.0 - g[1, 1]) + (half - J[2]) * (1.0 - g[2, 2])) / h


@record
class OfTheVelocity(lm.DiscreteLagrangian):
    """h xi . J xi/2, written once more."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    moments: Vec

    def value(self, xi: Vec, h: float) -> float:
        return 0.5 * h * dot(xi, self.moments * xi)


@record
class Skewed(lm.DiscreteLagrangian):
    """h l(xi) and a term of higher order that is not odd in h."""

    moments: Vec

    def value(self, xi: Vec, h: float) -> float:
        return 0.5 * h * dot(xi, self.moments * xi) + 0.1 * h * h * xi[0] ** 3


def run(
    method: lm.Method, h: float = 0.2, steps: int = 10, system: Any = BODY, start: Any = START, **options: Any
) -> Any:
    return lm.integrate(system, method, start, h=h, steps=steps, **({"compiled": False} | options))


def apart(a: Any, b: Any) -> float:
    return float(max(np.abs(a.mu - b.mu).max(), np.abs(a.g - b.g).max()))


# ------------------------------------------------------------------ equivalences


@RETRACTIONS
def test_the_trace_form_is_the_method_of_moser_and_veselov(retraction: lm.Retraction) -> None:
    """Whatever the coordinates: L_d is a function on the group."""
    assert apart(run(lm.CovariantVariational(retraction, Trace(J))), run(lm.MoserVeselov())) <= 1e-14


@RETRACTIONS
def test_h_l_is_the_default(retraction: lm.Retraction) -> None:
    assert (
        apart(run(lm.CovariantVariational(retraction, OfTheVelocity(J))), run(lm.CovariantVariational(retraction)))
        <= 1e-14
    )


def test_the_inverse_of_the_element_reverses_the_convention() -> None:
    """With f = q_1^-1 q_0 for the argument, the same function of f gives the steps of L_d(g^-1);
    the trace does not mind.
    """

    @record
    class Inverse(Trace):
        def on_group(self, g: Mat, h: float) -> float:
            return Trace(self.moments).on_group(g.T, h)

    assert apart(run(lm.CovariantVariational(lm.Cayley(), Inverse(J))), run(lm.MoserVeselov())) <= 1e-14


def test_the_momentum_is_that_of_the_first_line_of_algorithm_1() -> None:
    """mu = (1/h) (dtau^-1_{h xi})* dl_d/dxi, by the method's `momentum`, is what the step starts from."""
    for action in Trace(J), OfTheVelocity(J), lm.QuadratureLagrangian():
        method, h = lm.CovariantVariational(lm.Cayley(), action), 0.2
        xi = method.velocity(BODY, START.mu, h)
        assert np.abs(np.array(method.momentum(BODY, xi, h)) - np.array(START.mu)).max() < 2e-15
        stepped = run(method, h, 1)
        assert np.abs(stepped.g[1] - np.array(START.g) @ np.array(lm.SO3().cayley(h * np.array(xi)))).max() < 2e-15


# ------------------------------------------------------------------ orders and structure


@pytest.mark.slow
@RETRACTIONS
def test_quadrature_is_of_order_four(retraction: lm.Retraction) -> None:
    for nodes in 2, 3:
        method = lm.CovariantVariational(retraction, lm.QuadratureLagrangian(nodes))
        assert method.order == 4
        errors = []
        for steps in 5, 10:
            exact = BODY.exact(START, 1.0)
            last = run(method, 1.0 / steps, steps)
            errors.append(max(np.abs(last.mu[-1] - exact.mu).max(), np.abs(last.g[-1] - exact.g).max()))
        assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.2


def test_the_action_is_that_of_the_motion_up_to_the_fifth_power_of_h() -> None:
    """h l - (h^3/24) w . J^-1 w, w = ad*_xi p: the Legendre transform of h H + (h^3/6) s_3."""
    xi, moments = lm.vec(0.4, -0.7, 0.5), np.array(J)
    w = np.cross(moments * np.array(xi), xi)
    for retraction, share in (lm.Exponential(), 1.0 / 24.0), (lm.Cayley(), None):
        rest = []
        for h in 0.2, 0.1:
            action = lm.QuadratureLagrangian().action(BODY, retraction, xi, h)
            rest.append((action - h * BODY.lagrangian.value(xi)) / h**3)
        if share is not None:
            assert abs((4.0 * rest[1] - rest[0]) / 3.0 + share * float(w @ (w / moments))) < 1e-4
        assert abs(rest[1] / rest[0] - 1.0) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("action", [Trace(J), Skewed(J), lm.QuadratureLagrangian()], ids=lambda a: type(a).__name__)
def test_momenta_are_kept_and_steps_are_poisson_maps(action: lm.DiscreteLagrangian) -> None:
    method = lm.CovariantVariational(lm.Cayley(), action)
    samples = run(method, steps=20)
    assert samples.drift()["spatial momentum"].largest < 1e-14
    assert samples.drift()["Casimir 1"].largest < 1e-14
    assert lm.poisson_defect(method, BODY, BODY.state(START.mu), 0.2) < 1e-10


def test_symmetry_is_the_claim_of_the_lagrangian() -> None:
    """And no more than that: the skewed one is not undone by a step backwards."""
    for action, undone in (Trace(J), True), (Skewed(J), False):
        method = lm.CovariantVariational(lm.Exponential(), action)
        assert method.symmetric is undone
        there = run(method, 0.2, 1).last
        back = run(method, -0.2, 1, start=BODY.state(there.mu, there.g))
        off = np.abs(back.mu[-1] - np.array(START.mu)).max()
        assert off < 1e-14 if undone else off > 1e-5


@pytest.mark.slow
def test_a_body_without_a_closed_lagrangian_on_another_group() -> None:
    """A fish: order 4 on SE(3)."""
    system = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.5, 2.0, 1.2, 1.4, 1.9]))
    start = system.state([0.3, -0.4, 0.5, 0.2, 0.6, -0.3], np.eye(4))
    method = lm.CovariantVariational(lm.Exponential(), lm.QuadratureLagrangian())
    fine = run(lm.Taylor(12, lm.Exponential()), 0.25, 2, system, start)
    errors = [apart(run(method, 0.5 / n, n, system, start, every=n), _ends(fine)) for n in (2, 4)]
    assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.3


def _ends(samples: Any) -> Any:
    class Ends:
        mu, g = samples.mu[[0, -1]], samples.g[[0, -1]]

    return Ends


@pytest.mark.slow
def test_claims_of_the_order_four_method() -> None:
    report = lm.check_method(lm.CovariantVariational(lm.Cayley(), lm.QuadratureLagrangian()), BODY, START)
    assert report, report


# ------------------------------------------------------------------ refusals


def test_bad_lagrangians_are_refused() -> None:
    with pytest.raises(InvalidType, match="DiscreteLagrangian"):
        lm.CovariantVariational(lm.Cayley(), BODY.lagrangian)
    with pytest.raises(InvalidInput, match="nodes"):
        lm.QuadratureLagrangian(1)
    with pytest.raises(NotDefined, match="value"):
        lm.DiscreteLagrangian().value(lm.vec(1.0, 0.0, 0.0), 0.1)
    with pytest.raises(InvalidInput, match="not symmetric"):
        lm.Composition(lm.CovariantVariational(lm.Cayley(), Skewed(J)))
    top = lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0]).reduced
    with pytest.raises(IncompatibleSystem, match="lagrangian"):
        lm.CovariantVariational(lm.Exponential(), lm.QuadratureLagrangian()).require(top)
