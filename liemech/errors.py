"""Everything that liemech raises, one tree.

LiemechError
├── InvalidInput         a wrong call: names the argument, the value and the cure             (also a ValueError)
├── InvalidType          a wrong call: an argument of the wrong type                           (also a TypeError)
├── IncompatibleSystem   this method does not accept this system; says which methods do        (also a TypeError)
├── NotCompilable        a formula uses what native code cannot express: class, method, line   (also a TypeError)
├── NotDefined           a class lacks a method that its subclasses may write          (also a NotImplementedError)
├── MissingExtra         an optional package is needed; says how to install it                 (also an ImportError)
├── MissingProgram       a program is needed that this machine has not; says how to install it (also an OSError)
├── BrowserFailure       the browser that draws pictures did not do what it was told          (also a RuntimeError)
├── BufferOverrun        native code wrote where it must not: with LIEMECH_GUARD=1            (also a SystemError)
├── LawViolation         a group, algebra, tableau or structure breaks a law it must obey      (also a ValueError)
└── IntegrationFailure   a run that ended early; `.trajectory` holds every accepted sample     (also an ArithmeticError)
    ├── NoConvergence       an implicit step could not be solved
    ├── OutsideChart        a step, or an argument, is where the retraction is no chart             (also a ValueError)
    ├── NotFinite           a step produced inf or nan
    ├── StepTooSmall        adaptive steps became too small, or too many, to reach the end
    ├── InvalidTimeScale    a time transformation whose scale is not positive
    └── InconsistentState   the state is off the group, the orbit or the constraint

KeyboardInterrupt
└── IntegrationInterrupted   Ctrl-C during a run; `.trajectory` holds the samples so far
"""

from __future__ import annotations

import os
import sys
import warnings
from typing import Any


class LiemechError(Exception):
    """Base of every error raised by liemech."""


class InvalidInput(LiemechError, ValueError):
    """An argument has a value that cannot be meant."""


class InvalidType(LiemechError, TypeError):
    """An argument is of a type that cannot be meant."""


class IncompatibleSystem(LiemechError, TypeError):
    """The method does not accept the system."""


class NotCompilable(LiemechError, TypeError):
    """A formula cannot be turned into native code; it still runs in plain Python."""


class NotDefined(LiemechError, NotImplementedError):
    """A class leaves a method to its subclasses, or has no formula for it."""


def undefined(thing: object, method: str) -> NotDefined:
    """The error of a method that the class of a thing must define."""
    return NotDefined(f"{type(thing).__name__} must define `{method}`")


def require(name: str, value: Any, kind: Any, wanted: str = "") -> None:
    """Raise InvalidType for an argument of another kind; of a class it says that the brackets are missing.

    name : of the caller and of the argument.  wanted : what it must be, in words.
    """
    if not isinstance(value, kind):
        cure = f"; write {value.__name__}(...), with the brackets" if isinstance(value, type) else ""
        raise InvalidType(f"{name} must be {wanted or f'a {kind.__name__}'}; got {value!r}{cure}")


class MissingExtra(LiemechError, ImportError):
    """An optional package is needed: the message ends with the command that installs it."""

    def __init__(self, message: str, extra: str) -> None:
        super().__init__(f'{message}: pip install "liemech[{extra}]"')
        self.extra = extra


class MissingProgram(LiemechError, OSError):
    """A program is needed that is not on the search path of this machine."""


class BrowserFailure(LiemechError, RuntimeError):
    """The browser that draws pictures, or the page in it, did not do what it was told."""


class BufferOverrun(LiemechError, SystemError):
    """Native code has written outside of the memory that it was given: a fault of liemech."""


class LawViolation(LiemechError, ValueError):
    """A law of the mathematics does not hold for an object that claims it."""


class InertiaWarning(UserWarning):
    """The inertia can be integrated but belongs to no rigid body made of positive masses."""


class OrderWarning(UserWarning):
    """A method is of lower order than its coefficients are: as it was told to be, at jumps of an input, or from a start
    that the ends of a field do not allow.
    """


class GradientWarning(UserWarning):
    """A motion is so sensitive to its start that a gradient through it has lost most of its digits."""


class StepWarning(UserWarning):
    """A step is so large that its equation may have no solution, or several."""


class NotCompiledWarning(UserWarning):
    """A formula could not be compiled and runs, much slower, in plain Python."""


class FileWarning(UserWarning):
    """A file was written by another version of the library or of Python, or on another machine."""


class FormulaWarning(UserWarning):
    """A saved run was made by other formulas than those that its classes have now."""


class IntegrationFailure(LiemechError, ArithmeticError):
    """A run ended before its last step; `trajectory` holds every sample that was accepted, `reached`
    the state after the last step that was, and `clock`, in fictive time, when: t, tau and z.
    """

    trajectory: Any = None  # a Trajectory
    reached: Any = None  # a State; None if there was no step
    clock: Any = None


class NoConvergence(IntegrationFailure):
    """An implicit step could not be solved."""


class OutsideChart(IntegrationFailure, ValueError):
    """The step leaves the domain on which the retraction is a chart of the group."""


class NotFinite(IntegrationFailure):
    """A step produced an infinity or a nan."""


class StepTooSmall(IntegrationFailure):
    """Adaptive steps became too small to advance the time, or more than were allowed."""


class InvalidTimeScale(IntegrationFailure):
    """Physical time would stand still or run backwards: the scale of a time transformation is not
    positive.
    """


class InconsistentState(IntegrationFailure):
    """The state is not on the group, the orbit or the constraint manifold."""


class IntegrationInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a run; `trajectory` holds every sample that was recorded before."""

    trajectory: Any = None  # a Trajectory


# ------------------------------------------------------------------ what an exception of a formula means

PROGRAMMING = (
    TypeError,
    NameError,
    AttributeError,
    LookupError,
    ImportError,
    SyntaxError,
    NotImplementedError,
    RecursionError,
)
"""Exceptions that tell of a mistake in the program, not of a step that cannot be made: they are
raised as they are.
"""


def is_mistake(error: BaseException | None) -> bool:
    """Whether the exception of a formula is a mistake in the program.  Any other one is a failure of the
    step in which it was raised.
    """
    return isinstance(error, (*PROGRAMMING, LiemechError)) and not isinstance(error, IntegrationFailure)


def failure(error: Exception | None, what: str, at: str) -> IntegrationFailure:
    """The failure that an exception of a formula stands for, with the exception as its cause; for
    None, a result that is not finite.

    what : which method failed.  at : where.
    """
    if isinstance(error, IntegrationFailure):
        cls, text = type(error), str(error)
    elif isinstance(error, ArithmeticError):
        cls, text = NotFinite, f"{what}: {error}"
    elif error is not None:
        cls, text = IntegrationFailure, f"{what}: {type(error).__name__}: {error}"
    else:
        cls, text = (NotFinite, f"{what}: the step overflowed or left the domain of a formula; a smaller h may help")
    exception = cls.__new__(cls)  # of a user's class too, whatever its constructor takes
    exception.args, exception.__cause__ = (f"{text} [{at}]",), error
    return exception


def warn(message: str, category: type[Warning]) -> None:
    """Warn at the line outside of this package that led here."""
    package, level = os.path.dirname(__file__) + os.sep, 2
    frame = sys._getframe(1)
    # of a dataclass: no file
    while frame.f_back is not None and frame.f_code.co_filename.startswith((package, "<string>")):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)
