"""The options of a run as one record, which a plan checks before anything moves: one table says which
option is for which control.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..errors import InvalidInput
from . import arguments

EQUAL, TOLERANCE, FICTIVE = "equal", "tolerance", "fictive"
"""Controls: fixed steps, by an error estimate, fixed in fictive time."""

_NOT_FICTIVE = "is not for steps in fictive time, as {method!r} makes them by h"
_ADAPTIVE = "is for adaptive steps; give t_end and, if you like, h as the first step"

REFUSED: dict[str, dict[str, str]] = {
    EQUAL: {
        "rtol": _ADAPTIVE,
        "atol": _ADAPTIVE,
        "max_step": _ADAPTIVE,
        "dense": "is for adaptive steps; fixed ones keep no way between them",
    },
    TOLERANCE: {
        "every": "is for fixed steps; adaptive ones have t_eval",
        "precision": "is for fixed steps; give h and steps",
        "compensated": "is for fixed steps; adaptive ones have larger errors than rounding",
    },
    FICTIVE: dict.fromkeys(
        ("precision", "rtol", "atol", "max_step", "dense", "breaks"), _NOT_FICTIVE
    ),
}
"""Which option is refused under which control, and why."""


class Options(NamedTuple):
    """The options of a plan, each as for `integrate`."""

    h: Any = None
    rtol: Any = None
    atol: Any = None
    max_step: Any = None
    breaks: Any = ()
    every: int = 1
    record: Any = None
    events: Any = ()
    dense: bool | None = None
    compensated: bool | None = None
    precision: str = "double"
    compiled: bool | None = None
    progress: bool | None = None
    workers: int = 1

    def checked(self) -> Options:
        """Checked options: each is a value that it may have."""
        for name in ("compensated", "compiled", "progress", "dense"):
            arguments.choice(getattr(self, name), name)
        arguments.digits(self.precision, self.compensated)
        return self._replace(
            breaks=arguments.jumps(self.breaks),
            record=arguments.names(self.record),
            every=arguments.count(self.every, "every", 1),
            workers=arguments.count(self.workers, "workers", 1),
            events=arguments.events(self.events),
        )

    @property
    def adaptive(self) -> dict[str, Any]:
        """The options that adaptive steps alone have."""
        return {name: getattr(self, name) for name in ("rtol", "atol", "max_step")}

    @property
    def asks_for_tolerance(self) -> bool:
        """Are steps to be chosen by an error estimate?"""
        return self.h is None or any(x is not None for x in self.adaptive.values())

    def require(self, control: str, method: Any) -> None:
        """Refuse what is not for a control."""
        if control == FICTIVE and self.h is None:
            raise InvalidInput("integrate: give h, the step in fictive time, and steps or t_end")
        if control == TOLERANCE:
            arguments.only_adaptive(method, self.h, **self.adaptive)
        for name, why in REFUSED[control].items():
            given = getattr(self, name)
            if given is None or given == Options._field_defaults[name]:
                continue
            if control == EQUAL and given is True:  # of fixed steps too the state is known
                continue
            raise InvalidInput(f"integrate: {name} {why.format(method=method)}")
