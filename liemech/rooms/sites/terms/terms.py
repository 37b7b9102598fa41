"""Energies of many sites: sums of terms over the edges of graphs.

H = sum over terms, sum over edges (a, b, ...) of  term.energy(a, b, ...)
"""

from __future__ import annotations

import functools
import inspect
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ....errors import InvalidInput, InvalidType, undefined
from ....formulas import Mat, Record, Vec, check_finite, derivative, gradient, jacobian, mat, record, vec
from ....formulas.calls.arguments import ordinary
from ....formulas.classes.derived import derived, derived_from
from ....formulas.classes.fields import FrozenDict
from ....formulas.classes.of_each import Each
from ....formulas.classes.overriding import asked
from ....formulas.classes.records import records_in, with_fields, with_records
from ....formulas.classes.signatures import bare
from ....formulas.derivatives import gradient_to_add
from ....formulas.vectors import small
from ....systems.hamiltonian import Hamiltonian
from ....systems.many.energies import StandsForAnEnergy
from ....systems.potential import Force, Potential
from ..graphs import EachSite, Graph

NEARLY = 0.7
"""A parameter of sites whose name is so much like `held` is a slip."""


# ------------------------------------------------------------------ what a user writes


@record
class Site(Record):
    """A site as a term sees it: its momentum `mu`, its element `g`, its velocity `xi` (None where
    they do not count), and its own parameters by their names.
    """

    mu: Any = None
    g: Any = None
    xi: Any = None


@functools.cache
def site_class(names: tuple[str, ...]) -> Any:
    """The class of sites with parameters of these names."""
    if not names:
        return Site
    name = f"Site_{'_'.join(names)}"
    fields = {"__annotations__": dict.fromkeys(names, Any), "__module__": __name__}
    return record(type(name, (Site,), fields | dict.fromkeys(names)))


@record
class Term(Record, StandsForAnEnergy):
    """An energy of one site, of two, or of three, which is summed over the edges of a graph.

    1. A subclass writes `energy(a)`, `energy(a, b)` or `energy(a, b, c)`, as a formula of the
    momenta `a.mu`, the elements `a.g`, and the parameters of sites that `Terms` was given, such as
    `a.mass`.  Its fields are the parameters (`float`, `Vec`, `Mat`); `each(values)` in place of one
    gives every edge its own.
    2. The derivatives follow; `slope` and `force` may be written in closed form.
    3. An energy that changes with time takes it last, `energy(a, b, t)`.
    4. A force without an energy is a term with `covector(t, a)` or `covector(t, a, b)` instead.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.2, for
    the energy of one body.
    """

    time_unit: ClassVar[str] = ""  # in pictures, of a term whose constants have units
    says_resistance: ClassVar[bool] = False  # does a subclass write what damps?

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.says_resistance = bare(cls.resistance) is not bare(Term.resistance)

    if TYPE_CHECKING:  # with as many arguments as there are sites
        energy: ClassVar[Any]
        covector: ClassVar[Any]
        resistance: ClassVar[Any]

    else:

        def energy(self, *sites: Any) -> float:
            """The energy of an edge.  sites : those that it ties, as many as the formula takes."""
            raise undefined(self, "energy")

        def covector(self, t: float, *sites: Any) -> Vec:
            """The force on the first of the sites in its axes, where there is no energy: friction, a
            drive.  It is a function of the velocities `a.xi` and the elements `a.g`.
            """
            raise undefined(self, "covector")

        @asked
        @derived_from("covector")
        def resistance(self, t: float, along: Vec, *sites: Any) -> Vec:
            """The damping -d covector/d a.xi along a velocity of the first of the sites, (dim,): what an explicit kick
            has to resolve.  For a force whose size is bounded, such as regularised dry friction, a subclass may
            say zero.
            """
            me, others = sites[0], sites[1:]
            return -derivative(lambda x: self.covector(t, with_fields(me, xi=x), *others), me.xi, along)

    @derived
    def slope(self, k: int, *sites: Any) -> Vec:
        """The derivative by the momentum of site number k of the edge, (dim,)."""

        def moved(m: Any) -> Any:
            return self.energy(*[with_fields(s, mu=m) if j == k else s for j, s in enumerate(sites)])

        return gradient_to_add(moved, sites[k].mu)

    @derived
    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """The force on site number k of the edge, <f, eta> = -d/ds energy(... g exp(s eta) ...) at
        s = 0.
        """

        def moved(eta: Any) -> Any:
            moved_site = with_fields(sites[k], g=group.compose_exp(sites[k].g, eta))
            return self.energy(*[moved_site if j == k else s for j, s in enumerate(sites)])

        return -gradient(moved, vec(*[0.0 for _ in range(group.dim)]))

    @derived
    def slopes(self, *sites: Any) -> tuple[Vec, ...]:
        """The derivatives by the momenta of all sites of the edge."""
        return tuple([self.slope(k, *sites) for k in range(len(sites))])

    @derived
    def forces(self, group: Any, *sites: Any) -> tuple[Vec, ...]:
        """The forces on all sites of the edge: to be written where they have more in common than their
        energy.
        """
        return tuple([self.force(group, k, *sites) for k in range(len(sites))])

    @derived
    def stiffnesses(self, group: Any, *sites: Any) -> tuple[tuple[Mat, ...], ...]:
        """The fall of the forces as sites move: block (i, j) is -d/ds of the force on site i as site j goes along g
        exp(s eta), (dim, dim).
        """
        n = group.dim

        def held_back(eta: Vec) -> Vec:
            moved_sites = [
                with_fields(s, g=group.compose_exp(s.g, eta[n * k : n * k + n])) for k, s in enumerate(sites)
            ]
            return vec(*[-x for f in self.forces(group, *moved_sites) for x in f])

        slope = jacobian(held_back, vec(*[0.0 for _ in range(n * len(sites))]))
        parts = [(n * k, n * k + n) for k in range(len(sites))]
        return tuple([tuple([mat(*[slope[r][a:b] for r in range(i, j)]) for a, b in parts]) for i, j in parts])

    def over(self, graph: Any = None, of: Any = None) -> Over:
        """The sum of the term over the edges of a graph, such as `neighbours.ring(100)`; of no graph
        over sites.

        of : where sites are of several species, that of the ends of an edge, or those: 0, or (0, 1).
        """
        name = type(self).__name__
        if graph is not None and not isinstance(graph, Graph):
            raise InvalidType(f"{name}.over: a graph, such as neighbours.ring(100); got {graph!r}")
        if graph is None:
            _require_one(f"{name}.over", self)
        graph = EachSite() if graph is None else graph
        return Over(self, graph, _species(f"{name}.over", graph, of))


def _species(name: str, graph: Graph, of: Any) -> tuple[int, ...]:
    """The species of the ends of an edge; () if nothing is said."""
    if of is None:
        return ()
    species = [*map(ordinary, of if isinstance(of, (tuple, list)) else (of,) * graph.arity)]
    if len(species) != graph.arity or not all(type(k) is int and k >= 0 for k in species):
        raise InvalidInput(
            f"{name}: of is the number of a species, from 0, or one for each of the {graph.arity} "
            f"sites of an edge of {graph!r}; got {of!r}"
        )
    return tuple(species)


@record
class Over(Record, StandsForAnEnergy):
    """A term and the graph over whose edges it is summed.

    of : the species of the ends of an edge; (): there is one only.
    """

    term: Term
    graph: Graph
    of: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        takes = self.arguments
        if takes is not None and takes != self.graph.arity:
            what = {1: "one site", 2: "two sites", 3: "three sites"}
            raise InvalidInput(
                f"{type(self.term).__name__}.energy takes {what.get(takes, f'{takes} sites')}, and an "
                f"edge of {self.graph!r} has {self.graph.arity}"
            )

    @property
    def arguments(self) -> int | None:
        """The number of sites that the energy is made for; None for any."""
        names = _arguments(type(self.term))
        return None if names is None else len(names)

    def __repr__(self) -> str:
        species = self.of[0] if len({*self.of}) == 1 else self.of
        words = [*[repr(self.graph)] * (not isinstance(self.graph, EachSite)), *[f"of={species}"] * bool(self.of)]
        return f"{self.term!r}.over({', '.join(words)})" if words else repr(self.term)


def is_a_force(cls: Any) -> bool:
    """Whether a class of terms has no energy, but a force."""
    return bare(cls.energy) is bare(Term.energy) and bare(cls.covector) is not bare(Term.covector)


def _arguments(cls: Any) -> tuple[str, ...] | None:
    """The names of the sites that the formula of a class of terms takes."""
    code = bare(cls.covector if is_a_force(cls) else cls.energy).__code__
    if code.co_flags & inspect.CO_VARARGS:
        return None
    names = tuple(code.co_varnames[1 : code.co_argcount])
    if "t" in (names[1:] if is_a_force(cls) else names[:-1]):
        where = "first: covector(self, t, a)" if is_a_force(cls) else "last: energy(self, a, t)"
        raise InvalidInput(f"{cls.__name__}: the time of ({', '.join(names)}) comes {where}")
    return names[1:] if is_a_force(cls) else tuple([name for name in names if name != "t"])


@record
class AtTime(Term):
    """A term that changes with time, frozen at one time."""

    term: Term
    time: float = 0.0

    def __repr__(self) -> str:
        return repr(self.term)

    def energy(self, *sites: Any) -> float:
        """The energy of the term at its time."""
        return self.term.energy(*sites, self.time)


def at_time(energy: Any, t: Any) -> Any:
    """An energy whose terms that change with time are frozen at time t."""
    changing = records_in(energy, AtTime)
    moved = [with_fields(x, time=t) for x in changing]
    return with_records(energy, AtTime, moved) if changing else energy


def timed(term: Term) -> Term:
    """The term, with its time for itself if it has one."""
    code = bare(type(term).energy).__code__
    return AtTime(term) if code.co_varnames[1 : code.co_argcount][-1:] == ("t",) else term


@record
class PerSite(Term):
    """An energy that every site has on its own, such as `PerSite(KineticEnergy(J))`, or a force.

    energy_of_one : a Hamiltonian, a Potential or a Force.  Its parameters may be `each(values)`, one
    for every site.
    """

    energy_of_one: Any

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.energy_of_one, (Hamiltonian, Potential, Force)):
            raise InvalidType(
                "PerSite: a Hamiltonian such as KineticEnergy([1.0, 1.5, 2.0]), or a Potential; got "
                f"{self.energy_of_one!r}"
            )

    def __repr__(self) -> str:
        return f"PerSite({self.energy_of_one!r})"

    def energy(self, a: Any) -> float:
        """The energy of the body at its momentum, or its element."""
        if isinstance(self.energy_of_one, Hamiltonian):
            return self.energy_of_one.energy(a.mu)
        return self.energy_of_one.energy(a.g)

    def covector(self, t: float, *sites: Any) -> Vec:
        """The force on the body at its velocity and element."""
        return self.energy_of_one.covector(t, sites[0].xi, sites[0].g)

    def resistance(self, t: float, along: Vec, *sites: Any) -> Vec:
        """The damping by its force."""
        return self.energy_of_one.resistance(t, sites[0].xi, sites[0].g, along)

    def slope(self, k: int, *sites: Any) -> Vec:
        """The gradient of the body's energy by its momentum; zero of a potential."""
        if isinstance(self.energy_of_one, Hamiltonian):
            return self.energy_of_one.gradient(sites[0].mu)
        return vec(*[0.0 for _ in sites[0].mu])

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """The force of the body's potential at its element; zero of a Hamiltonian."""
        if isinstance(self.energy_of_one, Potential):
            return self.energy_of_one.force(group, sites[0].g)
        return vec(*[0.0 for _ in range(group.dim)])


@record
class Terms(Record, StandsForAnEnergy):
    """A sum of terms over graphs, which is an energy of many sites: the Hamiltonian of a `LiePoissonSystem` on a power
    of a group, the potential of a `MechanicalSystem`, or the energy of `CotangentSites`.

    terms : terms over graphs, `Exchange(1.0).over(neighbours.ring(100))`; without `over` a term is
    one of every site.
    own : parameters of the sites by name (none that is nearly "held"), numbers for all or `each(values)`: with `mass=each(m)`
    formulas read `a.mass`.
    held : the numbers of sites that do not move: no slope and no force is theirs, others feel them.
    Where sites are of several species, own and held may be told of each, mass={0: each(m), 1: 18.0},
    held={1: [0, 5]}.
    pinned : the numbers of sites on SE(3) that turn where they are: no force moves them along.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.2.
    """

    terms: tuple[Any, ...]
    own: dict[str, Any]
    held: tuple[Any, ...] = ()
    pinned: tuple[Any, ...] = ()

    def __init__(self, *terms: Any, held: Any = (), pinned: Any = (), **own: Any) -> None:
        object.__setattr__(self, "terms", tuple([_over(term) for term in terms]))
        object.__setattr__(self, "own", {name: _parameters(name, x) for name, x in own.items()})
        object.__setattr__(self, "held", _held("held", held))
        object.__setattr__(self, "pinned", _held("pinned", pinned))
        self.__post_init__()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.terms:
            raise InvalidInput("Terms: give one term at least, such as Exchange(1.0).over(graph)")

    def __repr__(self) -> str:
        parameters = [f"{name}={value!r}" for name, value in self.own.items()]
        resting = [("held", self.held), ("pinned", self.pinned)]
        held = [f"{name}={_shown(sites)}" for name, sites in resting if sites]
        return f"Terms({', '.join([*map(repr, self.terms), *parameters, *held])})"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters of sites."""
        return tuple(self.own)


def as_terms(energy: Any) -> Any:
    """A single term as a sum of terms; other values unchanged."""
    return Terms(energy) if isinstance(energy, (Term, Over)) else energy


def _over(term: Any) -> Over:
    if isinstance(term, Over):
        return term
    if isinstance(term, Term):
        _require_one("Terms", term)
        return Over(term, EachSite())
    cure = "; write it with brackets" if isinstance(term, type) else ""
    raise InvalidType(f"Terms: a term such as Exchange(1.0).over(neighbours.ring(100)); got {term!r}{cure}")


def _require_one(name: str, term: Term) -> None:
    """Raise InvalidInput for a term of several sites without a graph."""
    takes = _arguments(type(term))
    if takes is not None and len(takes) != 1:
        raise InvalidInput(
            f"{name}: {type(term).__name__}.energy takes ({', '.join(takes)}): say over which "
            f"edges it is summed, {type(term).__name__}(...).over(neighbours.ring(100))"
        )


def _held(name: str, held: Any) -> tuple[Any, ...]:
    """Numbers of sites, in rising order; of several species pairs of a species and a number."""
    if held is None:
        return ()
    if isinstance(held, dict):
        return tuple(sorted({(k, i) for k, sites in _by_species(name, held).items() for i in _held(name, sites)}))
    numbers = np.atleast_1d(np.asarray(held))
    whole = numbers.dtype.kind in "iu" or (numbers.dtype.kind == "f" and (numbers == numbers // 1.0).all())
    if numbers.ndim != 1 or not whole:
        raise InvalidInput(
            f"Terms: {name} is the numbers of sites, [0, 5], or those of species, {{1: [0, 5]}}; got {held!r}"
        )
    return tuple(sorted({*map(int, numbers)}))


def _shown(held: tuple[Any, ...]) -> str:
    """The numbers of sites as they were given, in words."""
    if not isinstance(held[0], tuple):
        return str([*held])
    return str({k: [i for j, i in held if j == k] for k, _ in held})


def _parameters(name: str, value: Any) -> Any:
    """A parameter, one for all sites, or by species."""
    if not isinstance(value, dict):
        return _parameter(name, value)
    return FrozenDict({k: _parameter(name, x) for k, x in _by_species(name, value).items()})


def _by_species(name: str, given: dict[Any, Any]) -> dict[int, Any]:
    """Values of the species, by their numbers.  given : as a user gives them."""
    by_number = {ordinary(k): x for k, x in given.items()}
    wrong = [k for k in by_number if type(k) is not int or k < 0]
    if wrong:
        raise InvalidInput(f"{name}: its values are told by the numbers of species, from 0; got {wrong[0]!r}")
    return by_number


def _parameter(name: str, value: Any) -> Any:
    if name in ("mu", "g", "xi", "t"):
        raise InvalidInput(f"Terms: {name} is no parameter of a site, but where it is; name it otherwise")
    import difflib  # here, for an import does not wait for it

    if difflib.get_close_matches(name, ["held"], 1, NEARLY):
        raise InvalidInput(
            f"Terms: {name}: did you mean held? A parameter of the sites needs a name that is less like it"
        )
    if isinstance(value, Each):
        return value
    array = np.asarray(value)
    if array.dtype.kind in "fc" and not np.isfinite(array).all():
        check_finite(array, f"Terms: {name}")
    parameter = small(array)
    if isinstance(parameter, (int, float)) and not isinstance(parameter, bool):
        return float(parameter)
    if isinstance(parameter, Record) or not hasattr(parameter, "axes"):
        raise InvalidType(f"Terms: {name} is a number or a vector that all sites have, or each(values); got {value!r}")
    return parameter
