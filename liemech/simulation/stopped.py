"""The bodies of an ensemble that did not reach the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from ..errors import IntegrationFailure


class Stop(NamedTuple):
    """Where and why a body of an ensemble stopped: after how many steps, and what the next one failed of."""

    steps: int
    error: IntegrationFailure


class Stopped(Mapping[int, Stop]):
    """The bodies of an ensemble that did not reach the end, by their numbers; why, is found out
    when asked for.

    steps : how many steps each of them took.
    """

    def __init__(
        self, steps: Mapping[int, int] | None = None, failure: Callable[[int], IntegrationFailure] | None = None
    ) -> None:
        self.steps, self._failure = dict(steps or {}), failure
        self._errors: dict[int, IntegrationFailure] = {}

    def __getitem__(self, body: int) -> Stop:
        steps = self.steps[body]
        if body not in self._errors and self._failure is not None:
            self._errors[body] = self._failure(body)
        return Stop(steps, self._errors[body])

    def __iter__(self) -> Iterator[int]:
        return iter(self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"Stopped({self.steps!r})"

    def __getstate__(self) -> dict[str, Any]:
        """The fields for pickling: all reasons computed, without the run that computes them."""
        return {"steps": self.steps, "_failure": None, "_errors": {body: self[body].error for body in self}}


NONE = Stopped()
"""All have reached the end."""
