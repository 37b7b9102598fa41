"""Commutator-free methods: the motion as a product of flows with frozen velocities."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput
from ..formulas import Vec, record
from ..groups.retractions import Exponential
from ..systems.system import System
from ..tableaus.flows import CF3, CF4, CG3, CG4, LIE_EULER, LIE_MIDPOINT, FlowTableau
from .method import Method
from .orders import set_tableau
from .rkmk import combination


@record
class CommutatorFree(Method):
    """A commutator-free method: from stage to stage by exponentials alone, without dexp^-1, on any
    group.

    Stage i is reached by one flow after the other, and so is the end of the step, by the last rows
    of the tableau:

        k_i = xi(t + c_i h, x_i),   x_i = exp(h sum_j a_J,ij k_j) ... exp(h sum_j a_1,ij k_j) . x_n,   the first row first.

    order : of the tableau chosen, 1 (Lie-Euler), 2 (Lie-midpoint), 3 or 4; or give a `tableau`,
    such as CARPENTER_KENNEDY4 of `liemech.tableaus.flows`, with five velocities instead of four and
    errors that are 2 to 50 times smaller in the tests.  The flows must be exact, so the exponential
    is the only choice: with another retraction nothing above order 2 is left.  Mu and g move by the
    same increments, so the spatial momentum and the Casimirs are kept to rounding.  The energy
    drifts.

    Source: Celledoni, Marthinsen, Owren, Commutator-free Lie group methods, Future Gener. Comput.
    Syst. 19 (2003).
    """

    title: ClassVar[str] = "{0.tableau.name}"

    order: int = 4
    tableau: FlowTableau = None  # type: ignore[assignment]  # None: the one of this order

    choices: ClassVar[dict[int, FlowTableau]] = {t.order: t for t in (LIE_EULER, LIE_MIDPOINT, CF3, CF4)}

    def __post_init__(self) -> None:
        set_tableau(self, FlowTableau, self.choices)

    def step(self, system: System, t: float, state: Any, h: float) -> Any:
        """One step, from stage to stage.  To stages off its way only what the velocity depends on is moved."""
        data, place = self.tableau, state
        places: list[Any] = []
        velocities: list[Vec] = []
        for c, rows, origin, main in zip(data.c, data.flows[1:], data.origins[1:], data.main[1:]):
            places = [*places, place]
            velocities = [*velocities, system.rate(t + c * h, system.essential_part(place))]
            place = places[origin] if main else system.essential_part(places[origin])
            for row in rows:
                place = system.displaced(Exponential(), place, combination(row, velocities, h))
        return place

    def __repr__(self) -> str:
        is_default = self.tableau == self.choices.get(self.order)
        return f"{type(self).__name__}({f'order={self.order}' if is_default else f'tableau={self.tableau!r}'})"


@record
class CrouchGrossman(CommutatorFree):
    """A Crouch-Grossman method: a commutator-free one in which every flow follows a single
    velocity.

    order : of the tableau chosen, 1 to 4; or give a `tableau` whose rows have one weight each.
    Order 4 takes five velocities and fifteen exponentials, where `CommutatorFree` takes four and
    five: it is here to compare with.

    Source: Crouch and Grossman, J. Nonlinear Sci. 3 (1993); Hairer, Lubich, Wanner, IV.8.1.
    """

    choices: ClassVar[dict[int, FlowTableau]] = {t.order: t for t in (LIE_EULER, LIE_MIDPOINT, CG3, CG4)}

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(sum(map(bool, row)) > 1 for rows in self.tableau.flows for row in rows):
            raise InvalidInput(
                f"CrouchGrossman: {self.tableau!r} has flows of several velocities; it belongs to CommutatorFree"
            )

    __repr__ = CommutatorFree.__repr__
