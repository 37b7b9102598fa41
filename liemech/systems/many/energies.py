"""Energies and forces of many sites: the words by which systems and methods ask them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from ...errors import InvalidInput
from ...formulas import Record, Vec, record
from ...formulas.classes.records import records_in, with_records
from ...groups.lie_group import LieGroup
from ..hamiltonian import Hamiltonian

StandsForAnEnergy: Any = object
"""The base, for checkers of types, of what systems take as an energy and make one of."""


@record
class WithHeldSites(Record):
    """An energy or a force that may say that sites do not move; abstract."""

    def moving(self, xi: Vec) -> Vec:
        """A velocity with zeros where sites are held or pinned.  xi : (sites dim,), or (dim,) of one site."""
        raise NotImplementedError


def moving(energy: Any, xi: Vec) -> Vec:
    """A velocity; zero where the energy, of many sites or of one among them, says that sites are held or pinned."""
    return energy.moving(xi) if isinstance(energy, WithHeldSites) else xi


@record
class OfManySites(WithHeldSites):
    """An energy or a force of many sites; abstract.

    group : the power of a group, or the product of powers, whose copies are the sites.
    """

    group: Any

    @property
    def released(self) -> Any:
        """The energy with sites that are held free to move: its derivatives are those of the energy."""
        raise NotImplementedError

    @property
    def feels_velocity(self) -> bool:
        """Whether a force depends on the velocity."""
        raise NotImplementedError

    @staticmethod
    def held_together(name: str, body: Any, potential: Any, load: Any) -> tuple[Any, Any, Any]:
        """A body, its potential and its load (or None), with the sites held and pinned that any of them says.  Raises
        InvalidInput where one of them cannot leave a site where it is.
        """
        raise NotImplementedError


@record
class OfSpecies(Hamiltonian):
    """The energy of a site that is of one of several species; abstract."""

    def moved(self, mu: Vec, g: Any, formula: Callable[[Any, Any, Any, Any], Any]) -> Any:
        """The momentum and the element that formula(group, energy, mu, g) gives for the species of this site."""
        raise NotImplementedError


@functools.singledispatch
def on_group(energy: Any, kind: type, name: str, group: LieGroup) -> Any:
    """An energy of this kind on a group: terms become a sum over the sites, other values are unchanged.

    kind : Hamiltonian, DrivenHamiltonian, Potential or Force.  name : who asks, for messages.
    Raises InvalidInput for an energy of other sites than the group has.
    """
    for of_sites in records_in(energy, OfManySites):
        if of_sites.group.copies != getattr(group, "copies", None):
            raise InvalidInput(f"{name}: {of_sites!r} is of {of_sites.group.copies} sites, and the group is {group!r}")
    return energy


def released(system: Any) -> Any:
    """The system, or an energy, with sites that are held free to move: then forces are those of its energy."""
    held = records_in(system, OfManySites)
    return with_records(system, OfManySites, [energy.released for energy in held]) if held else system
