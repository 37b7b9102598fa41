"""The border of formulas: methods called with arrays check the shapes and broadcast; called with small vectors they are bare."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from .vectors import Mat, Vec

MANY = 2048  # elements from which native code, loaded from the disk cache, is quicker than a Python loop
evaluate_many: Callable[..., Any] | None = None  # set by the package: the compiler knows the border, not the border the compiler

_ARRAYS = (np.ndarray, list)
AXES = {"float": 0, "Vec": 1, "Mat": 2}


class Border:
    """A class whose public methods on `Vec` and `Mat` take arrays too."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name, member in vars(cls).copy().items():
            if inspect.isfunction(member) and not name.startswith("_"):
                kinds = _kinds(cls, name, member)
                if kinds:
                    setattr(cls, name, _bordered(member, kinds))

    def _shape(self, argument: str, axes: int) -> tuple[int, ...] | None:
        """The shape that an array argument with this many axes must have; None if any will do.  Subclasses know."""
        return None

    def _objection(self, argument: str, value: Any) -> str | None:
        """What is wrong with the value of an argument, an array or an option; None if nothing is.  Subclasses know."""
        return None


# ------------------------------------------------------------------ arrays


def real_array(value: Any, name: str) -> np.ndarray:
    """`value` as a float64 array, or a clear refusal: complex, object, string and ragged input is not guessed at."""
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name} has masked entries; fill or drop them first")
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name} is ragged: its rows have different lengths") from None
    if array.dtype.kind not in "iuf":
        raise InvalidType(f"{name} must be real numbers; got dtype {array.dtype}")
    return array.astype(np.float64, copy=False)


def check_finite(array: np.ndarray, name: str) -> None:
    """Refuse an array with an infinity or a nan, saying where it is."""
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        at = tuple(map(int, bad[0]))
        raise InvalidInput(f"{name}{list(at)} is {array[at]}; every entry must be finite")


# ------------------------------------------------------------------ methods


def annotation_text(annotation: Any) -> str:
    text = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
    return " | ".join(part.strip().split(".")[-1] for part in text.split("|"))


def _kinds(cls: type, name: str, method: Callable[..., Any]) -> dict[str, int] | None:
    """How many axes each argument has, from the annotations of the method or of the one it overrides."""
    kinds: dict[str, int] = {}
    for base in cls.__mro__:
        known = bare(vars(base)[name]) if inspect.isfunction(vars(base).get(name)) else None
        if known is not None:
            for argument, other in zip(_arguments(method), _arguments(known), strict=False):
                kind = AXES.get(annotation_text(known.__annotations__.get(other, "")))
                if kind is not None:
                    kinds.setdefault(argument, kind)
    return kinds if set(kinds.values()) & {1, 2} else None


def _arguments(method: Callable[..., Any]) -> tuple[str, ...]:
    """The names of the arguments after `self`; much quicker than `inspect.signature`, and every class pays for it on import."""
    code = method.__code__
    return code.co_varnames[1 : code.co_argcount]


def _bordered(formula: Callable[..., Any], kinds: dict[str, int]) -> Callable[..., Any]:
    """The formula with a border: array arguments are checked and broadcast, small vectors pass straight through."""
    names = _arguments(formula)

    @functools.wraps(formula)
    def method(self: Any, *args: Any, **options: Any) -> Any:
        for a in args:
            if isinstance(a, _ARRAYS) or type(a) is tuple:
                return _broadcast(formula, kinds, self, dict(zip(names, args, strict=False)) | options)
        if options and any(isinstance(a, _ARRAYS) or type(a) is tuple for a in options.values()):
            return _broadcast(formula, kinds, self, dict(zip(names, args, strict=False)) | options)
        return formula(self, *args, **options)

    method.__formula__ = formula  # type: ignore[attr-defined]
    return method


def bare(method: Any) -> Any:
    """The formula behind the border of a method; anything else is what it is."""
    return getattr(method, "__formula__", method)


def _broadcast(formula: Callable[..., Any], kinds: dict[str, int], self: Any, arguments: dict[str, Any]) -> Any:
    where = f"{type(self).__name__}.{formula.__name__}"
    space = arguments.get("group", self)  # who knows the shapes
    arrays: dict[str, np.ndarray] = {}
    for name, value in arguments.items():
        if name not in kinds or value is None or isinstance(value, (bool, str, Border)):
            _refuse(space, where, name, value)
            continue
        array = real_array(value, f"{where}: {name}")
        axes = kinds[name]
        shape = space._shape(name, axes) if axes else ()
        core = array.shape[array.ndim - axes :] if axes else ()
        if array.ndim < axes or (shape is not None and core != shape):
            expected = shape if shape is not None else ("n",) * axes
            raise InvalidInput(f"{where}: {name} has shape {array.shape}; its last axes must be {expected}")
        check_finite(array, f"{where}: {name}")
        _refuse(space, where, name, array)
        arrays[name] = array
    lead = {name: a.shape[: a.ndim - kinds[name]] for name, a in arrays.items()}
    try:
        batch = np.broadcast_shapes(*lead.values())
    except ValueError:
        raise InvalidInput(f"{where}: the leading axes {lead} do not broadcast") from None
    rest = {k: v for k, v in arguments.items() if k not in arrays}
    flat = {k: _flattened(a, batch, a.shape[len(lead[k]) :]) for k, a in arrays.items()}
    bodies = math.prod(batch)
    if not bodies:  # an element of the right shape tells the shape of nothing
        some = {k: np.eye(*a.shape[1:])[None] if a.ndim == 3 else np.zeros((1, *a.shape[1:])) for k, a in flat.items()}
        return _unflattened(_none_of(_stacked([formula(self, **element(some, 0), **rest)])), batch)
    results = None
    if bodies >= MANY and evaluate_many is not None:
        results = evaluate_many(formula, self, flat, rest)
    try:
        if results is None:
            results = _stacked([formula(self, **element(flat, i), **rest) for i in range(bodies)])
    except (ZeroDivisionError, OverflowError) as error:
        raise InvalidInput(f"{where} has no finite value for these arguments: {error}") from error
    _defined(results, where, flat)
    return _unflattened(results, batch)


def element(arrays: dict[str, np.ndarray], i: int) -> dict[str, Any]:
    """The arguments number i, as small vectors and plain floats."""
    return {name: (float, Vec.of, Mat.of)[a.ndim - 1](a[i].tolist()) for name, a in arrays.items()}


def _refuse(space: Any, where: str, name: str, value: Any) -> None:
    objection = space._objection(name, value)
    if objection:
        raise InvalidInput(f"{where}: {name} {objection}")


def _defined(results: Any, where: str, flat: dict[str, np.ndarray]) -> None:
    """Refuse to hand out what is no number."""
    if isinstance(results, tuple):
        for part in results:
            _defined(part, where, flat)
        return
    bad = np.flatnonzero(~np.isfinite(results.reshape(len(results), -1)).all(axis=1))
    if len(bad):
        at = ", ".join(f"{name} = {a[bad[0]].tolist()}" for name, a in flat.items())
        raise InvalidInput(f"{where} has no finite value at {at}")


def _none_of(one: Any) -> Any:
    return tuple(map(_none_of, one)) if isinstance(one, tuple) else one[:0]


def _flattened(array: np.ndarray, batch: tuple[int, ...], core: tuple[int, ...]) -> np.ndarray:
    return np.broadcast_to(array, batch + core).reshape(-1, *core)


def _unflattened(result: Any, batch: tuple[int, ...]) -> Any:
    if isinstance(result, tuple):
        return tuple(_unflattened(part, batch) for part in result)
    shaped = result.reshape(batch + result.shape[1:])
    return shaped if shaped.ndim else float(shaped)


def _stacked(results: list[Any]) -> Any:
    if isinstance(results[0], tuple) and not isinstance(results[0], Vec):
        return tuple(_stacked(list(part)) for part in zip(*results, strict=True))
    return np.array(results, dtype=float)
