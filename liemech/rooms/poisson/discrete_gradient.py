"""Steps that keep the laws of thermodynamics: energy by a discrete gradient, entropy by its own sum of squares."""

from __future__ import annotations

import functools
from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, NoConvergence
from ...formulas import Mat, Vec, dot, jacobian, record, sqrt
from ...integrators.method import Method
from ...integrators.rkmk import combination
from ...solvers import LIMIT, newton
from ...tableaus.collocation import gauss
from ...tableaus.trees import Row
from .metriplectic import Metriplectic


@record
class DiscreteGradient(Method):
    """The midpoint rule with the mean of the gradient for dH: a metriplectic step that keeps the energy to rounding
    and never lowers the entropy.

        mu_n+1 - mu_n = h ({m, H} + (m, S)),   m = (mu_n + mu_n+1)/2,   dS that at m,
        dH = int_0^1 dH(mu_n + s (mu_n+1 - mu_n)) ds

    H(mu_n+1) - H(mu_n) = dH . (mu_n+1 - mu_n) = 0, for both brackets are skew in dH.  S grows by h sum_k A_k(dH, dS)^2
    where it is a function of Casimirs of degree 1 or 2, in the first order of its slope.  Order 2, symmetric.

    nodes : of Gauss' quadrature for the mean, exact for energies of degree 2 nodes; others are kept to a power
    2 nodes + 1 of the step.

    Raises IncompatibleSystem for systems that are not Metriplectic, NoConvergence for steps that are too long.
    Source: McLachlan, Quispel, Robidoux, Geometric integration using discrete gradients, Phil. Trans. R. Soc. A 357
    (1999), equation (1.5); Oettinger, GENERIC integrators, J. Non-Equilib. Thermodyn. 43 (2018), 89.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True

    nodes: int = 4
    name = "Discrete gradient"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.nodes <= 8:
            raise InvalidInput(f"DiscreteGradient: nodes from 1 to 8; got {self.nodes!r}")

    def require(self, system: Any) -> None:
        super().require(system)
        if not isinstance(system, Metriplectic):
            raise IncompatibleSystem(
                f"{self!r} is for lm.Metriplectic(system, entropy, friction); got {system!r}. ImplicitMidpoint() keeps "
                "quadratic energies of rotations, RKMK(order=4) accepts every system"
            )

    def step(self, system: Metriplectic, t: float, state: Any, h: float) -> Any:
        """Solve for the change of mu, from that of Euler's step."""
        mu = getattr(state, system.part)
        guess = h * system.rate(t, state)
        d, size, enough, _ = newton(lambda d: self.equation(system, h, mu, d), guess, dot(mu, mu) + dot(guess, guess))
        if not size <= enough:
            raise NoConvergence(
                f"{self!r}: Newton's method did not converge in {LIMIT} iterations: mismatch {sqrt(size):.1e}, "
                f"wanted {sqrt(enough):.1e}. The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
            )
        return system.moved(state, d)

    def equation(self, system: Metriplectic, h: float, mu: Vec, d: Vec) -> tuple[Vec, Mat, float]:
        """d - h ({m, H} + (m, S)) and its derivative, beside |mu|^2."""

        def residual(d: Vec) -> Vec:
            m = mu + 0.5 * d
            return d - h * system.change(m, self.mean(system, mu, d), system.entropy.gradient(m))

        return residual(d), jacobian(residual, d), 1.0

    def mean(self, system: Metriplectic, mu: Vec, d: Vec) -> Vec:
        """The mean of dH between mu and mu + d.  mu, d : (dim,)."""
        places, weights = self.quadrature
        return combination(weights, [system.gradient(mu + c * d) for c in places])

    @functools.cached_property
    def quadrature(self) -> tuple[Row, Row]:
        """The places and weights of Gauss."""
        data = gauss(self.nodes)
        return data.c, data.b
