"""From its start to its goals a run makes pieces of some steps; between them it shows how far it has come,
is saved, and hears Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from ...errors import IntegrationInterrupted, failure, is_mistake
from ..reports.progress import Bar
from ..result import of_run
from ..trajectory import Trajectory


class Course:
    """A run: of bodies (run.py), of bodies side by side (equal.py), or of the sites of one system
    (sites/run.py), each with its own `piece`; abstract.

    checkpoint : where it is saved on its way, or None.  bodies : of an ensemble their number.
    """

    by_sites: ClassVar[bool] = False
    adaptive: Any = False
    plan: Any
    checkpoint: Any
    bodies: int | None = None

    # ---------------------------------------------------------------- what a run has of its own

    def piece(self) -> int | None:
        """Make the steps of one piece; returns their number over all bodies, None if the run is at its end."""
        raise NotImplementedError

    @property
    def measure(self) -> tuple[int, str]:
        """Total and unit of the progress bar."""
        raise NotImplementedError

    @property
    def shown(self) -> int:
        """The part of the total of `measure` that is done."""
        raise NotImplementedError

    @property
    def worth_saving(self) -> bool:
        """Whether a checkpoint that is due is written at this place."""
        return True

    def so_far(self) -> str:
        """Where an interrupted run stands, as words for its error."""
        raise NotImplementedError

    def require_ends(self) -> None:
        """Raise the error of a run that has not come to its end."""

    def settle(self, error: Any) -> bool:
        """Forget what lies beyond the place where this error ended the run; returns whether it can go on."""
        return True

    def tell(self, made: Trajectory) -> None:
        """Warn of what the user should know of a run that has come to its end."""

    # ---------------------------------------------------------------- the loop

    def trajectory(self) -> Trajectory:
        """Run to the goals and return all samples; errors carry the run so far."""
        try:
            with Bar(self.plan.options.progress, *self.measure) as bar:
                self._march(bar)
            self.require_ends()
            run: Trajectory = of_run(self)
        except (Exception, KeyboardInterrupt) as error:
            raise self._stopped(error) from error.__cause__
        self.tell(run)
        return run

    def _march(self, bar: Bar) -> None:
        """Make pieces until there are none, with progress and checkpoints in between."""
        checkpoint = self.checkpoint
        while (steps := self.piece()) is not None:
            bar.advance(self.shown - bar.done)
            if checkpoint is not None and checkpoint.due(steps) and self.worth_saving:
                self.save()

    def save(self) -> None:
        """Write the run so far to the checkpoint."""
        self.checkpoint.save(of_run(self))

    def _stopped(self, error: Any) -> Any:
        """The error or interrupt that ends a run, with the run so far."""
        interrupted = isinstance(error, KeyboardInterrupt) and not isinstance(error, IntegrationInterrupted)
        if interrupted:
            error = IntegrationInterrupted()
        elif getattr(error, "trajectory", None) is not None and not self.bodies:
            return error
        goes_on = self.settle(error)
        error.trajectory = of_run(self, goes_on)
        if interrupted:  # it may stand further on than where it was last looked at
            error.args = (f"integrate: interrupted {self.so_far()}",)
        return error


def told(error: Any, method: Any, at: str, samples: Callable[[], int] | None) -> Any:
    """The error of a run that ends at a place: a failure of the method, or a mistake in a formula itself with a note.

    samples : how many there are; None beside other bodies.
    """
    if is_mistake(error):
        error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
        return error
    if samples is not None:
        at += f"; {samples()} samples are in `.trajectory`"
    return failure(error, repr(method), at)
