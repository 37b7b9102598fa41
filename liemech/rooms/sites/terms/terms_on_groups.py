"""Terms on the group of a system: sums of terms as a Hamiltonian, a potential or a load, checked and tried."""

from __future__ import annotations

from typing import Any

from ....errors import IncompatibleSystem, InvalidInput
from ....formulas.classes.records import fields_of, records_in, with_fields
from ....groups.composed.power import PowerGroup
from ....groups.composed.species import SpeciesGroup
from ....groups.lie_group import LieGroup
from ....groups.rigid.se3 import SE3
from ....systems.hamiltonian import Hamiltonian
from ....systems.in_time.driven_hamiltonian import DrivenHamiltonian
from ....systems.lagrangian import Lagrangian
from ....systems.many.energies import on_group
from ....systems.potential import Force, Potential
from .bound_terms import BoundTerm, bound, numbers_of, parameters
from .kinds_of_terms import kind_of
from .sums_of_terms import DrivenTerms, EnergyTerms, ForceTerms, KineticTerms, MomentumTerms, PlaceTerms
from .terms import AtTime, Over, PerSite, Term, Terms, as_terms, is_a_force
from .trials_of_terms import plain_term, tried


@on_group.register(Term)
@on_group.register(Over)
@on_group.register(Terms)
def _bound_on_group(energy: Any, kind: type, name: str, group: LieGroup) -> Any:
    """The sum of terms on a group as an energy of this kind."""
    return BOUND[kind](name, group, as_terms(energy))


def hamiltonian_of(name: str, group: LieGroup, terms: Terms) -> Any:
    hamiltonian = _sum(MomentumTerms, name, group, terms)
    _require_at_rest(name, hamiltonian, ": make it a DrivenLiePoissonSystem(group, terms)")
    single_energies = hamiltonian.of_one if isinstance(hamiltonian.of_one, tuple) else (hamiltonian.of_one,)
    kinetic = all(isinstance(energy, Lagrangian) for energy in single_energies)
    return KineticTerms(**fields_of(hamiltonian)) if kinetic else hamiltonian


def potential_of(name: str, group: LieGroup, terms: Terms) -> Any:
    potential = _sum(PlaceTerms, name, group, terms)
    cure = ", and potentials do not: write its force as a term with `covector(t, a)`, load=Terms(...)"
    _require_at_rest(name, potential, cure)
    return potential


BOUND: dict[type, Any] = {
    Hamiltonian: hamiltonian_of,
    DrivenHamiltonian: lambda *terms: DrivenTerms(_sum(MomentumTerms, *terms)),
    Potential: potential_of,
    Force: lambda *terms: _sum(ForceTerms, *terms),
    EnergyTerms: lambda *terms: _sum(EnergyTerms, *terms),
}
"""By kind of energy, the function that makes it of terms."""


def _require_at_rest(name: str, energy: Any, cure: str) -> None:
    """Raise IncompatibleSystem, with the cure, for a sum of terms of which one changes with time."""
    changing = records_in(energy, AtTime)
    if changing:
        raise IncompatibleSystem(f"{name}: {changing[0]!r} changes with time{cure}")


def _sum(kind: Any, name: str, group: LieGroup, terms: Terms) -> Any:
    if not isinstance(group, (PowerGroup, SpeciesGroup)):
        raise IncompatibleSystem(
            f"{name}: terms are energies of many sites, and {group!r} is the group of one; write "
            f"{group!r} ** sites, such as {group!r} ** 100"
        )
    parts = bound(terms, group)
    pinned = numbers_of(terms, "pinned", group)
    sum_of_terms = kind(group, parts, *parameters(terms, group), pinned)
    if pinned and not (isinstance(group, PowerGroup) and isinstance(group.base, SE3)):
        raise InvalidInput(f"{name}: pinned sites turn where they are, on SE3() ** n; the group is {group!r}")
    for part in parts:
        _require_kind(name, kind, part)
        _require_fitting(name, group, part)
    parts = tuple([tried(sum_of_terms, part) for part in parts])
    if kind is MomentumTerms:
        parts = tuple([with_fields(part, kind=kind_of(sum_of_terms, part)) for part in parts])
    return with_fields(sum_of_terms, parts=parts)


def _require_fitting(name: str, group: Any, part: BoundTerm) -> None:
    """Raise InvalidInput for the energy of a body of another dimension than its sites."""
    energy = getattr(part.term, "energy_of_one", None)
    base = group.powers[part.of[0]].base if part.of else group.base
    shape = None if energy is None else energy._shape("mu", "Vec")
    if shape not in (None, (base.dim,)):
        raise InvalidInput(
            f"{name}: {energy!r} takes vectors of {shape[0]} components; those of {base!r} have {base.dim}"
        )


def _require_kind(name: str, kind: Any, part: BoundTerm) -> None:
    term: Any = plain_term(part.term)
    energy = term.energy_of_one if isinstance(term, PerSite) else None
    base_class = next(base for base in (Hamiltonian, Potential, Force, EnergyTerms) if issubclass(kind, base))
    force = isinstance(energy, Force) if energy is not None else is_a_force(type(term))
    misplaced = energy is not None and base_class is not EnergyTerms and not isinstance(energy, base_class)
    if force != (base_class is Force) or misplaced:
        what = {
            EnergyTerms: "the energy takes energies of momenta and elements",
            Hamiltonian: "the Hamiltonian takes energies of momenta",
            Potential: "the potential takes energies of elements",
            Force: "the load takes forces, terms with `covector(t, a)`",
        }[base_class]
        raise InvalidInput(f"{name}: {what}; got {term!r}")
