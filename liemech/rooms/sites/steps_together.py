"""Methods that step all sites together, in memory."""

from __future__ import annotations

from typing import Any, ClassVar

from ...formulas import Record, record


@record
class StepsTogether(Record):
    """Steps of all sites at once, by `step_together`, from one copy of their memory to the other.

    name : of the method of one system.
    """

    name: str

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
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
