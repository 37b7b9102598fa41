"""Systems: a state that a group carries along, and the velocity with which it does."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from ..errors import undefined
from ..formulas import Complex, Record, Vec, record, vec
from ..formulas.classes.exact_keys import exact_key
from ..formulas.classes.fields import array_held
from ..formulas.classes.records import fields_of, names_of
from ..formulas.classes.remembered import Remembered
from ..formulas.large import Large
from ..formulas.numbers.double_double import DoubleDouble, is_long
from ..formulas.sites import mean
from ..formulas.vectors import Vec as SmallVec
from ..formulas.vectors import small
from ..groups.lie_group import LieGroup
from ..groups.matrices.matrix_group import MatrixLieGroup
from ..groups.retractions import Retraction
from .trial import require_results

LIBRARY = __name__.partition(".")[0]


@record
class State(Record):
    """The state of a system: arrays, of an ensemble with a leading axis; None for a part that is left out."""

    @classmethod
    def _wanted(cls, owner: Any) -> str:
        return f"come from {getattr(owner, 'called', System.called)}.state(...)"

    def _held(self, name: str, value: Any) -> Any:
        return array_held(self, name, value)

    @property
    def bodies(self) -> int | None:
        """The number of members of an ensemble; None for a single system."""
        cls: Any = type(self)
        for name in names_of(cls):
            x = getattr(self, name)
            if x is not None:
                return len(x) if isinstance(x, np.ndarray) else None
        return None

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The parts that are not left out, as arrays, by name."""
        return {name: np.asarray(x) for name, x in self.parts.items() if x is not None}

    @property
    def parts(self) -> dict[str, Any]:
        """The fields by their names."""
        return fields_of(self)


def state_of(kind: Any, arrays: Mapping[str, Any]) -> Any:
    """A state with these parts, of a kind of states."""
    return kind(*[arrays.get(name) for name in names_of(kind)])


def small_state(kind: Any, arrays: Mapping[str, Any], large: bool = False) -> Any:
    """The state of one body, as formulas take it.  large : do its numbers lie in memory?"""
    taken = Large if large else small
    return state_of(kind, {name: taken(np.asarray(x)) for name, x in arrays.items()})


def member(state: Any, i: int) -> Any:
    """The state of one body, of an ensemble of the i-th."""
    if state.bodies is None:
        return state
    large = getattr(state, "large", False)
    return small_state(type(state), {name: x[i] for name, x in state.arrays.items()}, large)


def lies_in_memory(group: LieGroup) -> bool:
    """Whether momenta and elements of the group are too large to be written out: large matrices."""
    return isinstance(group, MatrixLieGroup) and group.is_large


def as_precise(omega: Vec, part: Any) -> Vec:
    """A displacement in numbers of two doubles if the part of a state that it moves is made of
    them: a velocity may be given in doubles, but tau(omega) is on the group to all digits of omega.
    part : a vector or a matrix.
    """
    if isinstance(part, Large):
        return omega
    first = part[0]
    while isinstance(first, (SmallVec, np.ndarray)):
        first = first[0]
    if not is_long(first.re if isinstance(first, Complex) else first):
        return omega
    return vec(*[x if is_long(x) else DoubleDouble(x) for x in omega])


@record
class System(Record):
    """Motion by a group: at every moment a velocity in the Lie algebra, and a state that group
    elements carry along.

    side : "left" for body velocities, which move a group element as g exp(xi), "right" for spatial
    ones, exp(xi) g.

    called : what a user may call it, in messages.
    alternatives : what to use where a method does not accept the system, a sentence without its
    full stop.
    coordinates : the parts of the state whose components are numbers that vary freely, such as
    ("mu",) or ("q", "p").

    1. A subclass writes `rate`, `displaced` and `state`, and has a `group`.  (Mostly through one of
    the classes of this folder.)
    2. It may say what the velocity depends on (`essential_part`) and what stays constant
    (`constants`).

    Source: Munthe-Kaas, Appl. Numer. Math. 29 (1999), section 2: equations on homogeneous spaces.
    """

    side: ClassVar[str] = "left"
    called: ClassVar[str] = "system"
    coordinates: ClassVar[tuple[str, ...]] = ()
    alternatives: ClassVar[str] = "RKMK accepts every system"
    small: ClassVar[int] = 12  # up to so many numbers many sites are written out, as one body
    bounded: ClassVar[bool] = False  # does it depend on its parameters which states there are?
    driven: ClassVar[bool] = False  # does its energy change with time, `energy(t, ...)`?
    jointed: ClassVar[bool] = False  # are its sites bodies held together by joints?
    runs_in: ClassVar[str] = "rooms.sites.runs.plan:SitesOfPlan"  # of a site form: module and name of `runs_by_sites`
    noisy: ClassVar[bool] = False  # are there random numbers in its velocity?
    dissipative: ClassVar[bool] = False  # is there more in its motion than its velocity, a damping?
    time_unit: ClassVar[str] = "s"  # in pictures; "" for systems without units
    fictive: ClassVar[bool] = False  # is it one in a fictive time, with physical time in its state?
    if TYPE_CHECKING:  # a field here would be an argument of every system

        @property
        def group(self) -> LieGroup: ...

    def __post_init__(self, *_: Any) -> None:
        super().__post_init__()
        require_results(self)

    def rate(self, t: float, state: Any) -> Vec:
        """The velocity xi in the Lie algebra, (dim,), at time t and in this state."""
        raise undefined(self, "rate")

    def displaced(self, retraction: Retraction, state: Any, omega: Vec) -> Any:
        """The state after a displacement tau(omega)."""
        raise undefined(self, "displaced")

    def _reached(self, **parts: Any) -> Any:
        """The state with the parts to which a run has come: one to begin with, unless there are
        methods that leave where motions begin.
        """
        system: Any = self
        return system.state(**parts)

    def moving(self, state: Any, xi: Vec) -> Any:
        """xi . y, the rates of a state that moves with this velocity."""
        raise undefined(self, "moving")

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The lengths of blocks of components of the velocity that share a physical unit; by default those of the group."""
        return self.group.unit_blocks

    def essential_part(self, state: State) -> Any:
        """The part of the state that the velocity depends on; parts that are None in it need not be recorded."""
        return state

    def mean_over_sites(self, value: Any) -> Any:
        """The mean of a number or a vector over all sites; of one body the value itself."""
        return mean(value)

    @property
    def runs_by_sites(self) -> Any:
        """The class that makes the runs of a site form."""
        module, _, name = self.runs_in.partition(":")
        return getattr(import_module(f"{LIBRARY}.{module}"), name)

    @property
    def _turning_group(self) -> Any:
        """The group in whose algebra `_turning_velocity` is."""
        return self.group

    def _turning_velocity(self, t: float, state: Any) -> Vec:
        """The velocity by which a step is judged to span turns."""
        return self.rate(t, self.essential_part(state))

    @property
    def site_form(self) -> System | None:
        """The site form of a system of many sites; None if there is none."""
        return None

    @property
    def lie_poisson(self) -> Any:
        """The Lie-Poisson system with this very motion, by its `hamiltonian` alone; None if there is
        more to the motion, or something else.
        """
        return None

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Parts of states of many sites, with an axis of sites where users see none."""
        return arrays

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """The inverse of `by_site`; by default the arrays themselves."""
        return arrays

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The quantities that many sites keep beside the energy, by name, at many samples."""
        return {}

    def _written_out(self, state: Any) -> Any:
        """The state in the form of formulas: the numbers of all sites in a row."""
        return state

    def variation(self, state: Any, omega: Vec) -> tuple[Vec, Vec]:
        """The changes of the state by a small displacement omega, and the sizes of the numbers that change: for
        adaptive steps.
        """
        return omega, self.group.scale(None)

    def vouched(self, state: State, t: float = 0.0) -> Any:
        """The state, noted as checked by `state` of this system at time t, so that `integrate` need not check it again."""
        return self._vouched(state)

    def _vouched(self, state: State) -> Any:
        """`vouched`, without a check of the argument."""
        _checked.set(state, (type(self), self.group, self if self.bounded else None))
        return state

    @final
    def knows(self, state: State) -> bool:
        """Was the state made by `state`, of this system or one of its kind with the same states?"""
        return self._knows(state)

    def _knows(self, state: Any) -> bool:
        """`knows`, without a check of the argument."""
        checked = _checked.get(state)
        if checked is None or checked[:2] != (type(self), self.group):
            return False
        return not self.bounded or checked[2] is self or exact_key(checked[2]) == exact_key(self)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Quantities that the motion should keep, by name, each (n, ...), from the samples of a run."""
        return {}

    _space = property(attrgetter("group"))

    def _in_rows(self, value: Any, kind: str) -> Any:
        return self._space._in_rows(value, kind)

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        return self._space._out_of_rows(results, kind)


_checked = Remembered()
"""For each state that was checked: the class and the group of the system that checked it, or the
system, if more matters.
"""
