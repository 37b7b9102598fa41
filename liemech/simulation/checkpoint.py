"""Checkpoints: a run so far, written to a file from time to time."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from ..errors import InvalidInput, warn

SHARE = 0.05
"""Part of the time of a run that writing may take, unless it was said after how many steps."""

ENDINGS = ".npz", ".h5", ".hdf5", ""
"""Of files that are read again; a name without one is of NumPy's kind."""


def require_ending(path: str | os.PathLike[str], known: tuple[str, ...] = (*ENDINGS, ".csv")) -> str:
    """The ending of the name of a file to be written.  Raises InvalidInput for one that is not known."""
    ending = Path(path).suffix.lower()
    if ending not in known:
        raise InvalidInput(
            f"{os.fspath(path)}: the ending {ending!r} names no kind of file that a run is written to; take one of "
            f"{', '.join(filter(None, known))}"
        )
    return ending


class Checkpoint:
    """The file to which a run is saved, and how often: every `seconds`, less often if writing takes long, or every
    `steps`.

    A disk that is full, or may not be written to, does not end the run: a warning tells of it, the
    next checkpoint is tried in its turn, and at the end a warning tells if the last one failed.
    steps : None for seconds.
    """

    def __init__(self, path: str | os.PathLike[str], seconds: float, steps: int | None = None) -> None:
        self.path, self.seconds, self.steps = path, seconds, steps
        self.next, self.taken = time.perf_counter() + seconds, 0
        self.failed: Exception | None = None  # why the last one is not there
        self.failures, self.written = 0, ""  # how many are not, and what was written before

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        run = getattr(error, "trajectory", None)
        if run is not None and isinstance(error, KeyboardInterrupt):
            self.save(run)  # as far as it has come
        self.end(run)
        if self.failed is not None:
            outcome = f"the file has the run {self.written}" if self.written else "nothing is there of it"
            warn(
                f"integrate: checkpoint: {self.failures} could not be written to {self.path}, the "
                f"last one among them ({_why(self.failed)}); {outcome}.  run.save(...) writes the "
                "run itself",
                RuntimeWarning,
            )

    def end(self, run: Any) -> Any:
        """The run, which has ended; it is saved now if it was too short for a checkpoint before."""
        if run is not None and not self.written and not self.failures:
            self.save(run)
        return run

    def within(self, steps: int) -> int:
        """The smaller of `steps` and the number of steps until the next checkpoint."""
        return steps if self.steps is None else min(steps, self.steps - self.taken)

    def due(self, steps: int = 0) -> bool:
        """Count the steps taken since the last call; is a checkpoint due?"""
        if self.steps is None:
            return time.perf_counter() >= self.next
        self.taken += steps
        return self.taken >= self.steps

    def save(self, run: Any) -> None:
        """Save the run so far; the first write that fails is warned of, and the next checkpoint tries again."""
        start, self.taken = time.perf_counter(), 0
        try:
            run.save(self.path)
        except (OSError, MemoryError, InvalidInput) as error:
            self.failures, self.failed = self.failures + 1, error
            if self.failures == 1:
                warn(
                    f"integrate: checkpoint: {self.path} cannot be written, {_why(error)}; the run "
                    "goes on, and the next checkpoint is tried when it is due",
                    RuntimeWarning,
                )
        else:
            self.failed, self.written = None, f"up to step {run.steps}"
        ended = time.perf_counter()
        self.next = ended + max(self.seconds, (ended - start) / SHARE)


def _why(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
