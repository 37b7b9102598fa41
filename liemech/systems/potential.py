"""Fields of force on a Lie group: potentials, and forces that have none."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import undefined
from ..formulas import Element, Record, Vec, derivative, dot, gradient, record, vec
from ..formulas.classes.derived import derived, derived_from
from ..formulas.classes.overriding import asked
from ..groups.lie_group import LieGroup


@record
class Potential(Record):
    """The energy of a body as a function of where it is, V(g).

    1. A subclass writes `energy`, as a formula.  Its fields are the parameters (`float`, `Vec`,
    `Mat` or other records).
    2. It may write `force` in closed form; left out, it follows by differentiation, exact to
    rounding.
    3. It may say what its symmetry keeps (`symmetry`).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.7.
    """

    def energy(self, g: Any) -> float:
        """V(g).  g : an element."""
        raise undefined(self, "energy")

    @derived
    def force(self, group: LieGroup, g: Element) -> Vec:
        """The force f felt in the body, <f, eta> = -d/ds V(g exp(s eta)) at s = 0; on rotations a
        torque.

        g : an element.  Returns (dim,).
        """
        return -gradient(lambda eta: self.energy(group.compose_exp(g, eta)), vec(*[0.0 for _ in range(group.dim)]))

    def _free(self, group: LieGroup, g: Element) -> Vec:
        """The force, were a site that is held free."""
        return self.force(group, g)

    def require_start(self, name: str, group: LieGroup, mu: Any, g: Any) -> None:
        """Raise InvalidInput for a start where there is no such energy; name : who asks, for messages."""

    @derived_from("energy")
    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """The momenta that the motion keeps because V has a symmetry, by name, for the samples of a
        run.

        By Noether's theorem <K_g mu, eta> is kept if V(exp(s eta) g) = V(g).  mu : (..., dim),
        g : elements, arrays both.
        """
        return {}


@record
class NoPotential(Potential):
    """No field: V = 0."""

    def energy(self, g: Any) -> float:
        return 0.0

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The force without a field, zeros.  (dim,)"""
        return vec(*[0.0 for _ in range(group.dim)])

    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """Every motion: the whole spatial momentum."""
        return {"spatial momentum": group.K(g, mu)}


@record
class OneTerm(Potential):
    """The force of one of the terms of a potential of many, or of its site form.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.7.
    """

    terms: Any  # the potential
    k: int  # the number of the term

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The force of term k alone.  g : an element."""
        return self.terms.force_of(group, g, self.k)


@record
class Force(Record):
    """A force that has no potential, or one that changes with time: friction, thrust, a driven
    field.

    1. A subclass writes `covector`, as a formula.  Its fields are the parameters.

    coupled : is it that of one of many sites, which asks the others?
    Source: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10
    (2001), section 3.1 (the Lagrange-d'Alembert principle).
    """

    coupled: ClassVar[bool] = False

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """The force in the body at time t and body velocity xi, (dim,): <F, xi> is its power.
        xi : (dim,), g : an element.
        """
        raise undefined(self, "covector")

    @asked
    @derived_from("covector")
    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        """The damping -dF/dxi along a velocity, (dim,): what an explicit kick has to resolve.  For a force
        whose size is bounded, such as regularised dry friction, a subclass may say zero.
        xi, along : (dim,), g : an element.
        """
        return -derivative(lambda x: self.covector(t, x, g), xi, along)

    def _slopes(self, group: LieGroup, t: float, xi: Vec, g: Any, along: Vec) -> tuple[Vec, Vec]:
        """The derivatives of <along, F> by xi and by eta, dg = g hat(eta)."""
        by_xi = gradient(lambda x: dot(along, self.covector(t, x, g)), xi)
        moved = lambda x: dot(along, self.covector(t, xi, group.compose_exp(g, x)))  # noqa: E731
        return by_xi, gradient(moved, vec(*[0.0 for _ in along]))

    @property
    @derived_from("covector")
    def by_rate(self) -> bool:
        """Whether the force is a sum of efforts, each of which depends on its own rate alone."""
        return False

    def efforts(self, t: float, rates: Vec, g: Any) -> Vec:
        """The efforts, (n,).  rates : (n,), g : an element."""
        raise undefined(self, "efforts")

    def spread(self, t: float, efforts: Vec, g: Any) -> Vec:
        """The force by these efforts, (dim,).  efforts : (n,), g : an element."""
        raise undefined(self, "spread")

    def resistances(self, t: float, rates: Vec, g: Any) -> Vec:
        """The damping of each effort by its own rate, (n,).  rates : (n,), g : an element."""
        raise undefined(self, "resistances")

    @derived_from("covector")
    def rates(self, xi: Vec, g: Any) -> Vec:
        """The velocities that the force depends on, linear in xi, (n,): all of them, xi, by
        default.  xi : (dim,), g : an element.
        """
        return xi

    @derived_from("covector")
    def at_rates(self, t: float, rates: Vec, g: Any) -> Vec:
        """The force at these velocities, (dim,), so that `covector` is this at `rates(xi, g)`.

        Methods that solve for the force at the end of a step solve for them.  rates : (n,), g : an
        element.
        """
        return self.covector(t, rates, g)
