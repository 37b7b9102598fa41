"""The options of a run as one record, which a plan checks before anything moves: one table says which
option is for which control.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..errors import InvalidInput, InvalidType
from ..formulas.classes.frozen import frozen
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
    FICTIVE: dict.fromkeys(("precision", "rtol", "atol", "max_step", "dense", "breaks"), _NOT_FICTIVE),
}
"""Which option is refused under which control, and why."""


@frozen
class FixedSteps:
    """Fixed steps, as a value of `control=`: all of length h, in fictive time where the method or the
    system has one.

    h : the step, in s; negative runs backwards; (bodies,) gives every body its own.
    breaks, compensated, precision : as for `integrate`.
    """

    h: Any
    breaks: Any = ()
    compensated: bool | None = None
    precision: str = "double"


@frozen
class ErrorControl:
    """Adaptive steps, as a value of `control=`: the estimated error of each is at most
    atol + rtol |state|.

    rtol, atol : the tolerances; atol is 1e-9 if None.  h : the first step; None to find it.
    max_step : the longest step.  breaks : as for `integrate`.
    Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4.
    """

    rtol: Any = arguments.RTOL
    atol: Any = None
    h: Any = None
    max_step: Any = None
    breaks: Any = ()


@frozen
class Save:
    """The samples to keep of a run, as a value of `save=`: every n-th state, or those at given times, or
    functions of them.

    every : n, of fixed steps.  at : (n,) times, what `t_eval` is.
    record, dense : as for `integrate`.
    """

    every: int = 1
    at: Any = None
    record: Any = None
    dense: bool | None = None


CONTROL = "h", "rtol", "atol", "max_step", "breaks", "compensated", "precision"
SAVE = "every", "record", "dense"


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

    def with_values(self, control: Any, save: Any) -> Options:
        """The options with those of `control=` and `save=`, which are given there only."""
        words = words_of(control, save)
        for name in words:
            if not self.is_default(name):
                value = control if name in CONTROL else save
                raise InvalidInput(
                    f"integrate: {name} = {getattr(self, name)!r} is given beside {value!r}; give it there"
                )
        return self._replace(**words)

    def is_default(self, name: str) -> bool:
        """Whether an option has its default value."""
        value, default = getattr(self, name), Options._field_defaults[name]
        return value is default or (isinstance(value, (tuple, int, str)) and value == default)

    @property
    def adaptive(self) -> dict[str, Any]:
        """The options that adaptive steps alone have."""
        return {name: getattr(self, name) for name in ("rtol", "atol", "max_step")}

    @property
    def asks_for_tolerance(self) -> bool:
        """Whether steps are to be chosen by an error estimate."""
        return self.h is None or any(x is not None for x in self.adaptive.values())

    def require(self, control: str, method: Any) -> None:
        """Raise InvalidInput for an option that this control does not have."""
        if control == FICTIVE and self.h is None:
            raise InvalidInput("integrate: give h, the step in fictive time, and steps or t_end")
        if control == TOLERANCE:
            arguments.only_adaptive(method, self.h, **self.adaptive)
        for name, why in REFUSED[control].items():
            value = getattr(self, name)
            if value is None or value == Options._field_defaults[name]:
                continue
            if control == EQUAL and value is True:  # of fixed steps too the state is known
                continue
            raise InvalidInput(f"integrate: {name} {why.format(method=method)}")


def words_of(control: Any, save: Any) -> dict[str, Any]:
    """The options that `control=` and `save=` stand for, by name."""
    options: dict[str, Any] = {}
    for value, name, kinds, words in (
        (control, "control", (FixedSteps, ErrorControl), CONTROL),
        (save, "save", (Save,), SAVE),
    ):
        if value is None:
            continue
        if not isinstance(value, kinds):
            examples = "FixedSteps(h) or ErrorControl(rtol)" if name == "control" else "Save(every=10)"
            raise InvalidType(f"integrate: {name} is a value such as {examples}; got {value!r}")
        fields = vars(value)
        options |= {word: fields.get(word, Options._field_defaults[word]) for word in words}
    return options


def times_of(save: Any, t_eval: Any) -> Any:
    """The times at which states are kept."""
    at = None if save is None else save.at
    if at is not None and t_eval is not None:
        raise InvalidInput(f"integrate: t_eval is given beside {save!r}; give it there")
    return t_eval if at is None else at
