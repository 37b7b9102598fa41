"""The arguments of a method, converted and checked by what the method says they are (`Vec`,
`Element`, `float`, `LieGroup`, `str`, ...): a wrong one is refused with its name, its value and
what it must be.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType
from ..arrays import real_array, shown
from ..classes.signatures import ARRAYS, RECORDS, Signature, keywords, misspelt
from ..numbers.bases import InMemory, Pair, StandIn
from ..vectors import Mat, Vec
from .batches import broadcast, check_elements, refuse


def checked(signature: Signature, owner: Any, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """The method with every argument converted and checked."""
    formula, arguments = signature.formula, signature.bound(args, options)
    where = f"{type(owner).__name__}.{signature.name}"
    if arguments is None:
        parameters = keywords(formula)
        if parameters is not None and not options.keys() <= parameters.keys():
            raise misspelt(where, parameters, options)
        # a TypeError of Python's own: the number of arguments
        return formula(owner, *args, **options)
    for name, value in arguments.items():
        if name not in signature.kinds:  # a float too, where there is no vector beside it
            arguments[name] = _option(signature, owner, where, name, value)
    space = arguments.get("group", arguments.get("action", owner))  # who knows the shapes
    numbers = [
        name
        for name, value in arguments.items()
        if name in signature.kinds and not (value is None and signature.optional(name))
    ]
    for name, value in arguments.items():
        if signature.classes.get(name) in ARRAYS:
            arguments[name] = _whole_array(signature, space, where, name, value)
        elif name not in numbers:
            if not isinstance(value, np.ndarray):
                refuse(space, where, name, value)
            if signature.classes.get(name) == "str" and not isinstance(value, str):
                raise InvalidType(f"{where}: {name} must be a string; got {shown(value)}")
    if all(_is_small(arguments[name], signature.kinds[name]) for name in numbers):
        for name in numbers:
            if signature.kinds[name] == "float":
                arguments[name] = _number(where, name, arguments[name])
        return _small(signature, owner, space, where, arguments)
    return broadcast(signature, owner, space, where, arguments, numbers)


def _option(signature: Signature, owner: Any, where: str, name: str, value: Any) -> Any:
    """An argument that is no number of a formula: a record, a whole number, a choice by name."""
    text = signature.text(name)
    if value is None and signature.optional(name):
        return value
    if text in RECORDS:
        if not any(base.__name__ == text for base in type(value).__mro__):
            choices = RECORDS[text]._wanted(owner)
            raise InvalidType(f"{where}: {name} must {choices}; got {shown(value)}")
        trusted = signature.trusted[signature.names.index(name)]
        if trusted is not None:
            trusted.add(type(value))
    elif text == "float":
        if not _is_small(value, text):
            raise InvalidType(f"{where}: {name} must be a number; got {shown(value)}")
        return _number(where, name, value)
    elif text in _OPTIONS:
        needed, convert = _OPTIONS[text]
        try:
            return convert(value)
        except (TypeError, ValueError, OverflowError):
            raise InvalidType(f"{where}: {name} must be {needed}; got {shown(value)}") from None
    return value


def _of(*types: type) -> Callable[[Any], Any]:
    """A conversion that leaves values of these types unchanged."""

    def convert(value: Any) -> Any:
        if not isinstance(value, types):
            raise TypeError
        return value

    return convert


def ordinary(value: Any) -> Any:
    """An integer of NumPy as an int; other values unchanged."""
    return int(value) if isinstance(value, np.integer) else value


def whole(value: Any) -> int:
    """A whole number of any kind, such as numpy.int64, as an int; TypeError for anything else."""
    if isinstance(value, (bool, np.bool_)):
        raise TypeError
    return operator.index(value)


def _truth(value: Any) -> bool:
    return bool(_of(bool, np.bool_)(value))


def _generator(value: Any) -> Any:
    """A seed or generator of random numbers, as it came."""
    generators = (np.random.Generator, np.random.BitGenerator, np.random.SeedSequence)
    if not isinstance(value, generators) and (value := whole(value)) < 0:
        raise ValueError
    return value


def _axes(value: Any) -> tuple[int, ...]:
    """The leading axes of a result, from one number or several."""
    axes = tuple(map(whole, value)) if isinstance(value, (tuple, list)) else (whole(value),)
    if not all(0 <= n < 2**31 for n in axes) or math.prod(axes) >= 2**31:
        raise ValueError
    return axes


_OPTIONS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "int": ("a whole number", whole),
    "bool": ("True or False", _truth),
    "dict": ("a dict", _of(dict)),
    "Generator | int": ("a seed, a whole number from 0 on, or a numpy.random.Generator", _generator),
    "int | tuple": ("a whole number from 0 on, or several as a tuple, below 2**31 altogether", _axes),
}
"""By annotation, the words for other arguments and their conversions."""


def _whole_array(signature: Signature, space: Any, where: str, name: str, value: Any) -> np.ndarray:
    """An argument of a method that takes arrays itself."""
    array = real_array(value, f"{where}: {name}", space._complex("Element"))
    shape, is_array = space._shape(name, "Element"), signature.classes[name] == "ArrayLike"
    leading = array.shape[: max(array.ndim - len(shape), 0)] if is_array else ()
    if array.shape != leading + shape:
        raise InvalidInput(
            f"{where}: {name} has shape {array.shape}; it{'s last axes' if is_array else ''} must be {shape}"
        )
    if is_array:
        check_elements(space, where, name, array, leading)
    return array


def _is_small(value: Any, kind: str) -> bool:
    """Whether a value is what formulas hand to each other: a number, or a vector or matrix."""
    if kind != "float":
        return isinstance(value, (Vec, Mat, InMemory))
    if isinstance(value, (int, float, np.integer, np.floating)):
        return not isinstance(value, bool)
    # series, symbols
    return isinstance(value, (StandIn, Pair)) or hasattr(value, "elementary") or hasattr(value, "free_symbols")


def _number(where: str, name: str, value: Any) -> Any:
    """A real number as a float; stand-ins for numbers unchanged."""
    if not isinstance(value, (int, float, np.integer, np.floating)):
        return value
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidInput(f"{where}: {name} is {shown(value)}; it must be finite, and as a float")
    return number


def _small(signature: Signature, owner: Any, space: Any, where: str, arguments: dict[str, Any]) -> Any:
    """The formula on small vectors, the shapes known to be right."""
    _check_shapes(signature, space, where, arguments)
    try:
        return signature.kept(owner, signature.formula(owner, **arguments))
    except AttributeError:
        owner._explain(arguments)
        raise
    except KeyError as error:
        for name, value in arguments.items():
            if isinstance(value, dict) and error.args[0] not in value:
                raise InvalidInput(f"{where}: {name} has no {error.args[0]!r}; got {shown(value)}") from error
        raise


def _check_shapes(signature: Signature, space: Any, where: str, arguments: dict[str, Any]) -> None:
    for name, kind in signature.kinds.items():
        value: Any = arguments.get(name)
        shape = space._shape(name, kind) if isinstance(value, (Vec, Mat, InMemory)) else None
        if shape is not None and value.shape != shape:
            raise InvalidInput(f"{where}: {name} has shape {value.shape}; it must be {shape}")


# ------------------------------------------------------------------ what went wrong


def blame(signature: Signature, owner: Any, args: tuple[Any, ...], error: Exception) -> None:
    """Raise InvalidInput if the shapes of small vectors are why a formula failed; otherwise return."""
    arguments = signature.bound(args, {})
    if arguments is None:
        return
    if isinstance(error, AttributeError):
        owner._explain(arguments)
    space = arguments.get("group", arguments.get("action", owner))
    where = f"{type(owner).__name__}.{signature.name}"
    try:
        _check_shapes(signature, space, where, arguments)
        for name, value in arguments.items():
            if type(value) in (int, str):
                refuse(space, where, name, value)
    except InvalidInput as reason:
        raise reason from error
    except AttributeError:  # of a system that is still being made: the first error says it
        return
