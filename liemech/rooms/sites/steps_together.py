"""Methods that step all sites together, in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from ...compiler.sites.planes import each
from ...formulas import Record, record
from ...integrators.solvability import MOST, SHORTEST


@record
class StepsTogether(Record):
    """Steps of all sites at once, by `step_together`, from one copy of their memory to the other.

    name : of the method of one system.
    """

    name: str

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    looked_into = True
    place_of_site = None
    symmetric: ClassVar[bool] = False

    def __repr__(self) -> str:
        return self.name

    @property
    def room(self) -> int:
        """Rows of numbers that a step works with, before those of the system."""
        return 0


def copied(old: Any, new: Any) -> None:
    """The place, unchanged: its numbers lie in memory."""
    new.save(old.load())


def summed_over(column: Any, count: float) -> Any:
    """The sum of the values of the first sites, as many as `count`."""
    total = column.at(0)
    for k in range(1, int(count)):
        total = total + column.at(k)
    return total


def grown_together(sites: Any, work: Any, newton: Callable[..., Any], *args: Any) -> tuple[float, float]:
    """The part of a step, 1 or less, up to which a solution grows out of h = 0, and the last remark of `newton`.

    work : has the columns of unknowns and of slopes, the unknowns over the part, which are followed; those at h = 0 to
    begin with.  newton : at a part, after so many corrections: have more of them led to a solution there, how many are
    they by then, and a remark.

    Source: as for `grown`.
    """
    reached, piece, part, count, remark = 0.0, 1.0, 1.0, 0.0, 0.0
    while True:
        converged, count, remark = newton(part, count, sites, work, *args)
        if converged:
            reached, piece = part, 2.0 * piece
            if reached < 1.0:
                each(sites, scaled, 1.0 / part, work.unknown, work.slope)
        else:
            piece = 0.5 * piece
        part = min(1.0, reached + piece)
        if not (reached < 1.0 and piece > SHORTEST and count < MOST):
            break
        each(sites, scaled, part, work.slope, work.unknown)
    return reached, remark


def scaled(factor: float, column: Any, product: Any) -> None:
    """The parts of the value of a site, times a factor, in another column."""
    product.save(tuple([factor * x for x in column.load()]))
