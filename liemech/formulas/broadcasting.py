"""The border of formulas: methods called with arrays check the shapes and broadcast; called with small vectors they are bare."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from .complex_numbers import Complex
from .vectors import Mat, Vec

MANY = 512  # elements from which native code, loaded from the disk cache, is quicker than a Python loop
evaluate_many: Callable[..., Any] | None = None  # set by the package: the compiler knows the border, not the border the compiler

MEMBERSHIP = 1e-6
"""Arrays whose `defect` is larger are no elements with rounding errors but mistakes, and are refused."""

AXES = {"float": 0, "Vec": 1, "Mat": 2}
KINDS = ("Ambient", "Element", "Mat", "Vec", "float")
"""What an argument can be annotated as.  Of a method and the one it overrides, the earlier of these annotations counts.

An `Element` has as many axes as an element of the group has, and is one; an `Ambient` has only its shape.
"""

BARE = (Vec, Mat, float, str, bool, type(None))


class Border:
    """A class whose public methods on `Vec` and `Mat` take arrays too."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name, member in vars(cls).copy().items():
            if inspect.isfunction(member) and not name.startswith("_"):
                kinds = _kinds(cls, name, member)
                if kinds:
                    setattr(cls, name, _bordered(member, kinds))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        """The shape that an array argument of this kind must have; None if any will do.  Subclasses know."""
        return None

    @property
    def is_large(self) -> bool:
        """Are its matrices too large for formulas that are written out?"""
        return False

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        """A method on whole arrays, batch axis first, for owners that are large; None: use the formula."""
        return None

    def _complex(self, kind: str) -> bool:
        """May an argument of this kind have complex entries?  Subclasses know."""
        return False

    def _objection(self, argument: str, value: Any) -> str | None:
        """What is wrong with the value of an argument, an array or an option; None if nothing is.  Subclasses know."""
        return None


# ------------------------------------------------------------------ arrays


def real_array(value: Any, name: str, or_complex: bool = False) -> np.ndarray:
    """`value` as a float64 array, or a clear refusal: complex, object, string and ragged input is not guessed at.

    What has `as_matrix`, like SciPy's rotations, is asked for it.  With `or_complex` the array is complex128.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name} has masked entries; fill or drop them first")
    if hasattr(value, "as_matrix"):
        value = value.as_matrix()
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name} is ragged: its rows have different lengths") from None
    if array.dtype.kind not in ("iufc" if or_complex else "iuf"):
        raise InvalidType(f"{name} must be {'complex' if or_complex else 'real'} numbers; got dtype {array.dtype}")
    return array.astype(np.complex128 if or_complex else np.float64, copy=False)


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


def _kinds(cls: type, name: str, method: Callable[..., Any]) -> dict[str, str] | None:
    """What each argument is, from the annotations of the method and of those it overrides."""
    kinds: dict[str, str] = {}
    for base in cls.__mro__:
        known = bare(vars(base)[name]) if inspect.isfunction(vars(base).get(name)) else None
        if known is not None:
            for argument, other in zip(_arguments(method), _arguments(known), strict=False):
                kind = annotation_text(known.__annotations__.get(other, ""))
                if kind in KINDS and KINDS.index(kind) < KINDS.index(kinds.get(argument, "float")):
                    kinds[argument] = kind
                elif kind == "float":
                    kinds.setdefault(argument, kind)
    return kinds if set(kinds.values()) - {"float"} else None


def _arguments(method: Callable[..., Any]) -> tuple[str, ...]:
    """The names of the arguments after `self`; much quicker than `inspect.signature`, and every class pays for it on import."""
    code = method.__code__
    return code.co_varnames[1 : code.co_argcount]


def _bound(formula: Callable[..., Any], names: tuple[str, ...], args: tuple[Any, ...], options: dict[str, Any]) -> dict[str, Any]:
    """The arguments by their names, none of them twice and none too many."""
    given = dict(zip(names, args, strict=False))
    twice = given.keys() & options.keys()
    if len(args) > len(names) or twice:
        what = f"{min(twice)} is given twice" if twice else f"{len(args)} arguments are given, there are {len(names)}"
        raise InvalidType(f"{formula.__qualname__}({', '.join(names)}): {what}")
    return given | options


def _bordered(formula: Callable[..., Any], kinds: dict[str, str]) -> Callable[..., Any]:
    """The formula with a border: array arguments are checked and broadcast, small vectors pass straight through."""
    names = _arguments(formula)

    @functools.wraps(formula)
    def method(self: Any, *args: Any, **options: Any) -> Any:
        for a in args:
            if type(a) not in BARE and _is_array(a):
                return _broadcast(formula, kinds, self, _bound(formula, names, args, options))
        if options and any(map(_is_array, options.values())):
            return _broadcast(formula, kinds, self, _bound(formula, names, args, options))
        return formula(self, *args, **options)

    method.__formula__ = formula  # type: ignore[attr-defined]
    return method


def _is_array(value: Any) -> bool:
    kind: Any = type(value)
    return _of_arrays(kind)


@functools.cache
def _of_arrays(kind: type) -> bool:
    return issubclass(kind, (np.ndarray, list)) or kind is tuple or hasattr(kind, "as_matrix")


def bare(method: Any) -> Any:
    """The formula behind the border of a method; anything else is what it is."""
    return getattr(method, "__formula__", method)


def _broadcast(formula: Callable[..., Any], kinds: dict[str, str], self: Any, arguments: dict[str, Any]) -> Any:
    """The formula on arrays: shapes, numbers and membership are checked, leading axes broadcast."""
    where = f"{type(self).__name__}.{formula.__name__}"
    space = arguments.get("group", self)  # who knows the shapes
    arrays: dict[str, np.ndarray] = {}
    lead: dict[str, tuple[int, ...]] = {}
    for name, value in arguments.items():
        if name not in kinds or value is None or isinstance(value, (bool, str, Border)):
            _refuse(space, where, name, value)
            continue
        kind = kinds[name]
        array = real_array(value, f"{where}: {name}", space._complex(kind))
        shape = () if kind == "float" else space._shape(name, kind)
        axes = AXES[kind] if shape is None else len(shape)
        core = array.shape[array.ndim - axes :] if axes else ()
        if array.ndim < axes or (shape is not None and core != shape):
            expected = shape if shape is not None else ("n",) * axes
            raise InvalidInput(f"{where}: {name} has shape {array.shape}; its last axes must be {expected}")
        arrays[name], lead[name] = array, array.shape[: array.ndim - axes]
    try:
        batch = np.broadcast_shapes(*lead.values())
    except ValueError:
        raise InvalidInput(f"{where}: the leading axes {lead} do not broadcast") from None
    rest = {k: v for k, v in arguments.items() if k not in arrays}
    flat = {k: _flattened(a, batch, a.shape[len(lead[k]) :]) for k, a in arrays.items()}
    elements = [name for name in arrays if kinds[name] == "Element"]
    bodies = math.prod(batch)
    if not bodies:  # an element of the right shape tells the shape of nothing
        some = {k: _some(space, kinds[k], a.shape[1:])[None] for k, a in flat.items()}
        return _unflattened(_none_of(_stacked([formula(self, **element(some, 0), **rest)])), batch)
    large = self.is_large
    if bodies >= MANY and evaluate_many is not None and not large:
        found = evaluate_many(formula, self, flat, rest, elements, _who_knows_elements(space), MEMBERSHIP)
        if found is not None:
            results, suspects = found
            if len(suspects):
                _check(arrays, elements, space, where, batch, flat, suspects)
                _by_rows(formula, self, {k: a[suspects] for k, a in flat.items()}, rest, where)
            return _unflattened(results, batch)
    _check(arrays, elements, space, where, batch, flat, range(bodies))
    if large:
        results = self._in_numpy(formula.__name__, flat | rest)
        if results is not None:
            _defined(results, where, flat)
            return _unflattened(results, batch)
    return _unflattened(_by_rows(formula, self, flat, rest, where), batch)


def _check(
    arrays: dict[str, np.ndarray],
    elements: list[str],
    space: Any,
    where: str,
    batch: tuple[int, ...],
    flat: dict[str, np.ndarray],
    rows: Iterable[int],
) -> None:
    """Refuse numbers that are not finite and, in these rows, arrays that are no elements of the group."""
    for name, array in arrays.items():
        check_finite(array, f"{where}: {name}")
    for name in elements:
        one = arrays[name].ndim == flat[name].ndim - 1  # for all
        for i in [0] if one else rows:
            at = "" if one else list(map(int, np.unravel_index(i, batch)))
            _refuse(space, where, name, flat[name][i], f"{name}{at}")


def _by_rows(formula: Callable[..., Any], owner: Any, flat: dict[str, np.ndarray], rest: dict[str, Any], where: str) -> Any:
    """The formula in plain Python, and a clear refusal of what it has no value for."""
    try:
        results = _stacked([formula(owner, **element(flat, i), **rest) for i in range(len(next(iter(flat.values()))))])
    except (ZeroDivisionError, OverflowError) as error:
        raise InvalidInput(f"{where} has no finite value for these arguments: {error}") from error
    _defined(results, where, flat)
    return results


def element(arrays: dict[str, np.ndarray], i: int) -> dict[str, Any]:
    """The arguments number i, as small vectors and plain floats."""
    return {name: small(a[i]) for name, a in arrays.items()}


def small(array: np.ndarray) -> Any:
    """An array without a batch axis as a formula takes it: a float, a `Vec` or a `Mat`."""
    return (float, Vec.of, Mat.of)[array.ndim](array.tolist())


def _some(space: Any, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """An argument of this kind on which every formula has a value."""
    if kind in ("Element", "Ambient"):
        return np.array(_who_knows_elements(space).identity())
    return np.eye(*shape) if len(shape) == 2 else np.zeros(shape)


def _who_knows_elements(space: Any) -> Any:
    """The group itself, or that of a system or an action."""
    return space if hasattr(space, "identity") or not hasattr(space, "group") else space.group


def _refuse(space: Any, where: str, name: str, value: Any, shown: str | None = None) -> None:
    objection = space._objection(name, value)
    if objection:
        raise InvalidInput(f"{where}: {shown or name} {objection}")


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
    return shaped if shaped.ndim else shaped.item()


def _stacked(results: list[Any]) -> Any:
    first = results[0]
    if isinstance(first, tuple) and not isinstance(first, Vec):
        return tuple(_stacked(list(part)) for part in zip(*results, strict=True))
    if isinstance(first, bool):
        return np.array(results)
    entries = [*first[0]] if isinstance(first, Mat) else [*first] if isinstance(first, Vec) else [first]
    return np.array(results, dtype=complex if any(isinstance(x, Complex) for x in entries) else float)
