"""Separable systems of many sites: masses in R^n whose potential is a sum of terms over a graph."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import undefined
from ...formulas import Vec, record
from ...formulas.classes.derived import derived_from
from ...systems.mechanical import MechanicalSystem
from ...systems.separable import SeparableSystem


@record
class SeparableSite(SeparableSystem):
    """One site of a separable system: a mass in R^n, H(q, p) = K(p) + V(q), whose potential asks the
    other sites for where they are.

    mass : the site form of masses on VectorSpace(n).

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2.
    """

    mass: MechanicalSystem
    degrees: int = field(init=False, repr=False)  # type: ignore[misc]
    quadratic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "degrees", self.mass.body.group.dim)
        super().__post_init__()

    def kinetic(self, p: Vec) -> float:
        """The kinetic energy K(p) of the mass.  p : (n,)."""
        free: Any = self.mass.body
        return free.hamiltonian.energy(p)

    def potential(self, q: Vec) -> float:
        """The share of this site.  q : (n,)."""
        return self.mass.potential.energy(q)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The velocity.  q, p : (n,)."""
        return self.mass.velocity(p)

    def force(self, q: Vec, p: Vec) -> Vec:
        """The force on this site.  q, p : (n,)."""
        return self.mass.force(q)


@record
class SeparableSites(SeparableSystem):
    """A separable system of many sites, whose positions and momenta lie one after the other;
    abstract.

    A subclass says its `sites`, and gives the same system as `masses_in_space`, in the words of sums
    over graphs; T is the kinetic energy of masses.
    """

    quadratic: ClassVar[bool] = True
    small: ClassVar[int] = 48  # their forces are short

    @property
    def sites(self) -> int:
        """The number of sites, which a subclass says."""
        raise undefined(self, "sites")

    @derived_from("kinetic", "potential")
    def masses_in_space(self) -> MechanicalSystem | None:
        """The system as masses on a power of VectorSpace(n), with a potential of terms; None where an energy
        is known by its formula alone.
        """
        return None

    @cached_property
    def site_form(self) -> SeparableSite | None:
        """The site form; None of few sites, which are faster written out."""
        masses: Any = self.masses_in_space() if self.degrees > self.small else None
        site: Any = masses and masses.site_form
        return site and SeparableSite(site)

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Positions and momenta as (..., sites, n)."""
        return {name: np.asarray(x).reshape(*np.shape(x)[:-1], self.sites, -1) for name, x in arrays.items()}

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Positions and momenta as (..., sites n)."""
        return {
            name: np.asarray(x).reshape(*np.shape(x)[:-2], -1) if name in ("q", "p") else x
            for name, x in arrays.items()
        }
