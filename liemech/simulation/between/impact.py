"""Impacts without friction, by Newton's law of restitution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import InvalidInput, require
from ...formulas import derivative, dot, gradient, vec
from ...formulas.classes.frozen import frozen
from ...formulas.numbers.dual import value_of
from ...systems.cotangent import CotangentMotion
from .jump import Jump, slope

ROUNDING = 2.0**-40
"""Part of the rates by which that behind an impulse is missed in rounding."""

DOUBLINGS = 60
"""How often an impulse is doubled that is too small."""


@frozen(eq=False)
class Rebound:
    """The state after an impact, a function of time and state; the fields are those of `impact`."""

    system: Any
    gap: Callable[[float, Any], float]
    restitution: float

    def __call__(self, t: float, state: Any) -> Any:
        """mu+ = mu - (1 + e) (dphi/dt) w / <w, M^-1 w>, w = D_g phi."""
        mu, g, group = state.mu, state.g, self.system.configurations
        kind = type(state)
        w = gradient(lambda x: self.gap(t, kind(mu, group.compose_exp(g, x))), vec(*[0.0] * group.dim))
        xi = self.system.rates(t, mu, g)[0]
        mobility = dot(w, derivative(lambda m: self.system.rates(t, m, g)[0], mu, w))
        if not mobility > 0.0:
            raise InvalidInput(
                f"impact: gap(t, state) is a function of where the body is, state.g; its derivative is {w!r}"
            )
        closing = slope(self.gap, self.system, t, state)
        impulse = -(1.0 + self.restitution) * closing / mobility

        def missed(s: Any) -> Any:
            """How far the rate behind an impulse s w is from the one that is wanted."""
            return dot(w, self.system.rates(t, mu + s * w, g)[0] - xi) + (1.0 + self.restitution) * closing

        if abs(missed(impulse)) > ROUNDING * (abs(closing) + sum([abs(a * b) for a, b in zip(w, xi)])):
            impulse = self._solved(missed, value_of(impulse))
        return kind(mu + impulse * w, g)

    def _solved(self, missed: Callable[[Any], Any], guess: float) -> Any:
        """The impulse of an energy that is not quadratic in momenta, from that of the quadratic one; a step of Newton's
        method gives it the derivatives that numbers carry.
        """
        from scipy.optimize import brentq

        def value(s: float) -> float:
            return float(value_of(missed(s)))

        for _ in range(DOUBLINGS):
            if value(guess) * value(0.0) <= 0.0:
                s = float(brentq(value, 0.0, guess, xtol=np.finfo(float).tiny, rtol=4.0 * np.finfo(float).eps))
                return s - missed(s) / value_of(derivative(missed, s))
            guess = 2.0 * guess
        raise InvalidInput("impact: no impulse turns the velocity back: the energy is to be convex in the momentum")


@frozen(eq=False)
class Impact(Jump):
    """The jump of an impact, by the inertia of the body that runs."""

    then: Rebound

    def jump_of(self, system: Any) -> Impact:
        return Impact(self.when, replace(self.then, system=system))


def impact(system: CotangentMotion, gap: Callable[[float, Any], float], restitution: float = 1.0) -> Jump:
    """The jump of a body that meets a smooth wall, phi = 0: dphi/dt -> -e dphi/dt, by an impulse along w = D_g phi.

        mu+ = mu - (1 + e) (dphi/dt) w / <w, M^-1 w>,      H+ - H = -(1 - e^2) (dphi/dt)^2 / (2 <w, M^-1 w>) for a wall at rest

    if the energy is quadratic in momenta, else the impulse is solved for.  It keeps the momenta of symmetries of the wall,
    and for e = 1 a quadratic energy.

    system : a body in a field, MechanicalSystem; in a run that of the run counts, of an ensemble that of each body.
    gap : phi(t, state), in m, of state.g, zero at contact; the wall may move.
    restitution : e, 0 < e <= 1.
    Source: Brogliato, Nonsmooth Mechanics, 3rd ed. (2016), section 4.3; on Lie groups Tran and Leok, arXiv:2310.15356.
    """
    require("impact: system", system, CotangentMotion, "a body in a field, MechanicalSystem(body, NoPotential())")
    require("impact: restitution", restitution, (int, float), "a number, 0 < e <= 1")
    if not 0.0 < restitution <= 1.0:
        raise InvalidInput(
            f"impact: restitution is a number 0 < e <= 1; got {restitution!r}. Contact that lasts, e = 0, is no jump"
        )
    return Impact(gap, Rebound(system, gap, float(restitution)))
