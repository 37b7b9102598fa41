"""Broadcasting: methods called with arrays run over the leading axes; called with small vectors
they are the bare formula.

Every public method of a record passes here.  Arguments are converted and checked by what the method
says they are (`Vec`, `Element`, `float`, `LieGroup`, `str`, ...); a wrong one is refused with its
name, its value and what it must be.  What one formula hands to another (small vectors, floats,
records) is looked at only by its type and shape.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import operator
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from .annotations import kind_of, own_annotations
from .complex_numbers import Complex
from .numbers import CarriesMore, Pair, StandIn
from .of_math import taking_all
from .overriding import breaks, kept, promise
from .vectors import Mat, Vec, of_floats

MEMBERSHIP = 1e-6
"""Arrays whose `defect` is larger are no elements with rounding errors but mistakes, and are
refused.
"""

AXES = {"float": 0, "Vec": 1, "Mat": 2}
KINDS = ("Ambient", "Element", "Mat", "Vec", "float")
"""What an argument can be annotated as.  Of a method and the one it overrides, the earlier of these
annotations counts.

An `Element` has as many axes as an element of the group has, and is one; an `Ambient` has only its
shape.
"""

_records: dict[str, type[Broadcasting]] = {}
"""All classes of records by name: an argument annotated as one of them must be one."""


class Broadcasting:
    """A class whose public methods on `Vec` and `Mat` take arrays too."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        _records[cls.__name__] = cls
        for name, member in vars(cls).copy().items():
            if inspect.isfunction(member) and not name.startswith("_"):
                kinds = _kinds(cls, name, member)
                classes = _classes(cls, name, member)
                promised = promise(cls, name)
                if kinds or promised or next(iter(classes.values()), "Any") != "Any":
                    signature = Signature(name, bare(member), dict(kinds or {}), classes, promised)
                    setattr(cls, name, _broadcasting(signature))

    @classmethod
    def _wanted(cls, owner: Any) -> str:
        """What an argument that must be an instance must do, in a message of the owner's."""
        return f"be a {cls.__name__}"

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        """The shape that an array argument of this kind must have; None if any will do.  Subclasses
        know.
        """
        return None

    @property
    def is_large(self) -> bool:
        """Are its matrices too large for formulas that are written out?"""
        return False

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        """A method on whole arrays, batch axis first, for owners that are large; None: use the
        formula.
        """
        return None

    def _complex(self, kind: str) -> bool:
        """May an argument of this kind have complex entries?  Subclasses know."""
        return False

    def _objection(self, argument: str, value: Any) -> str | None:
        """What is wrong with the value of an argument, an array or an option; None if nothing is.
        Subclasses know.
        """
        return None

    def _explain(self, arguments: dict[str, Any]) -> None:
        """Raise why the owner cannot serve these arguments, if that is why a formula failed.
        Subclasses know.
        """


# ------------------------------------------------------------------ arrays


def real_array(value: Any, name: str, or_complex: bool = False) -> np.ndarray:
    """`value` as a float64 array, or a clear refusal: complex, object, string and ragged input is
    not guessed at.

    What has `as_matrix`, like SciPy's rotations, is asked for it.  With `or_complex` the array is
    complex128.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name} has masked entries; fill or drop them first")
    if hasattr(value, "as_matrix") and not isinstance(value, type):
        value = value.as_matrix()
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name} is ragged: its rows have different lengths") from None
    if array.dtype is _DOUBLE and not or_complex:
        return array
    if array.dtype.kind not in ("iufc" if or_complex else "iuf"):
        kind = "complex" if or_complex else "real"
        raise InvalidType(
            f"{name} must be {kind} numbers; got dtype {array.dtype} from {shown(value)}"
        )
    with np.errstate(over="ignore"):  # of long doubles; what becomes infinite is refused as that
        return array.astype(np.complex128 if or_complex else np.float64, copy=False)


_DOUBLE = np.dtype(float)


def at_a_glance(value: Any, shape: tuple[int, ...]) -> Any:
    """A list of numbers, or an array, as a `Vec` or `Mat` if it obviously has this shape and finite
    entries.

    None: it is something else, or something that only `real_array` and `check_finite` can judge.
    """
    kind = type(value)
    if kind is np.ndarray:
        return (
            of_floats(value)
            if value.dtype is _DOUBLE and value.shape == shape and len(shape) in (1, 2)
            else None
        )
    if kind not in _SEQUENCES or (len(value),) != shape:
        return None
    if not _FLOAT.issuperset(map(type, value)):
        whole = [x for x in value if type(x) is int]
        if (
            not _REAL.issuperset(map(type, value))
            or not -(2**53) < min(whole) <= max(whole) < 2**53
        ):
            return None
        value = map(float, value)
    made = tuple.__new__(Vec, value)
    return made if all(map(math.isfinite, made)) else None


_SEQUENCES, _FLOAT, _REAL = (
    frozenset([list, tuple, Vec]),
    frozenset([float]),
    frozenset([float, int]),
)


def check_finite(array: np.ndarray, name: str) -> None:
    """Refuse an array with an infinity or a nan, saying where it is."""
    if np.isfinite(array).all():
        return
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        at = tuple(map(int, bad[0]))
        raise InvalidInput(
            f"{name}{list(at) if at else ''} is {array[at]}; every entry must be finite"
        )


def shown(value: Any) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # somebody else's __repr__
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


# ------------------------------------------------------------------ what a method says of its
# arguments


def _kinds(cls: type, name: str, method: Callable[..., Any]) -> dict[str, str] | None:
    """What each argument is, from the annotations of the method and of those it overrides."""
    kinds: dict[str, str] = {}
    for base in cls.__mro__:
        known = bare(vars(base)[name]) if inspect.isfunction(vars(base).get(name)) else None
        if known is not None:
            annotations = own_annotations(known)
            for argument, other in zip(_arguments(method), _arguments(known), strict=False):
                kind = (
                    kind_of(annotations[other], known.__globals__) if other in annotations else None
                )
                if kind is not None and KINDS.index(kind) < KINDS.index(
                    kinds.get(argument, "float")
                ):
                    kinds[argument] = kind
                elif kind == "float":
                    kinds.setdefault(argument, kind)
    return kinds if set(kinds.values()) - {"float"} else None


def _classes(cls: type, name: str, method: Callable[..., Any]) -> dict[str, str]:
    """The annotations of a method's arguments as text; where they say nothing, of the method that
    it overrides.
    """
    found: dict[str, str] = {}
    for base in cls.__mro__:
        known = bare(vars(base)[name]) if inspect.isfunction(vars(base).get(name)) else None
        if (
            known is not None
            and known.__code__.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS) == 0
        ):
            for argument, other in zip(_arguments(method), _arguments(known), strict=False):
                text = _class_text(known.__annotations__.get(other, ""))
                if text and found.get(argument, "Any") == "Any":
                    found[argument] = text
    return found


def _class_text(annotation: Any) -> str:
    """An annotation without modules and brackets: "Generator | int | None", "int | tuple"."""
    text = (
        annotation
        if isinstance(annotation, str)
        else getattr(annotation, "__name__", str(annotation))
    )
    return re.sub(r"\w+\.|\[.*?\]", "", text)


def _arguments(method: Callable[..., Any]) -> tuple[str, ...]:
    """The names of the arguments after `self`; much quicker than `inspect.signature`, and every
    class pays for it on import.
    """
    code = method.__code__
    return code.co_varnames[1 : code.co_argcount]


# ------------------------------------------------------------------ methods


@dataclasses.dataclass(frozen=True, eq=False)
class Signature:
    """A method and what it says of its arguments: the kinds of numbers, and the classes of
    everything else.
    """

    name: str
    formula: Callable[..., Any]
    kinds: dict[str, str]
    classes: dict[str, str]
    promise: Any = None
    """What a user's method gives, by the one of the library that it overrides."""

    def __post_init__(self) -> None:
        for name, text in self.classes.items():
            if text.removesuffix(" | None") in KINDS[:-1]:  # Element | None
                self.kinds.setdefault(name, text.removesuffix(" | None"))

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        return _arguments(self.formula)

    @functools.cached_property
    def defaults(self) -> dict[str, Any]:
        given = self.formula.__defaults__ or ()
        return dict(zip(self.names[len(self.names) - len(given) :], given))

    @functools.cached_property
    def space_at(self) -> int | None:
        """Where the argument stands that knows the shapes of the others; None: the owner does."""
        return next((self.names.index(n) for n in ("group", "action") if n in self.names), None)

    def shapes(self, space: Any) -> tuple[Any, ...]:
        """The length of a vector, the shape of a matrix, for each argument; None: any.  The space
        remembers it.
        """
        kinds = [(name, self.kinds.get(name, "float")) for name in self.names]
        shapes = [space._shape(name, kind) if kind != "float" else None for name, kind in kinds]
        found = tuple([s[0] if s and len(s) == 1 else s or None for s in shapes])
        if not hasattr(space, "_shapes"):
            object.__setattr__(space, "_shapes", {})
        space._shapes[self] = found
        return found

    @functools.cached_property
    def trusted(self) -> tuple[set[type] | None, ...]:
        """The types that pass unseen, for each argument: those that one formula hands to another.
        None: all of them.
        """
        return tuple(map(self._trusted, self.names))

    def _trusted(self, name: str) -> set[type] | None:
        none = {type(None)} if self.optional(name) else set()
        kind = self.kinds.get(name, "float")
        if kind != "float":
            return ({Vec} if kind == "Vec" else {Mat} if kind == "Mat" else {Vec, Mat}) | none
        text = self.classes.get(name, "").removesuffix(" | None")
        passing: dict[str, set[type]] = {
            "float": {float} if self.kinds else set(),
            "int": {int},
            "bool": {bool},
        }
        return (
            passing.get(text, set()) | none
            if text in (*passing, *_OPTIONS, *_ARRAYS, *_records)
            else None
        )

    def bound(self, args: tuple[Any, ...], options: dict[str, Any]) -> dict[str, Any] | None:
        """The arguments by name; None if their number is wrong, which Python says best."""
        named = dict(zip(self.names, args)) | options
        if len(args) > len(self.names) or len(named) != len(args[: len(self.names)]) + len(options):
            return None
        return named if set(named) <= set(self.names) <= set(named) | set(self.defaults) else None

    def kept(self, owner: Any, result: Any) -> Any:
        """The result of the formula, if it is what was promised; else WrongResult."""
        if self.promise and breaks(self.promise, result):
            return kept(self.promise, f"{type(owner).__name__}.{self.name}", result)
        return result

    def optional(self, name: str) -> bool:
        """May the argument be None?"""
        return self.defaults.get(name, 0) is None or "None" in self.classes.get(name, "").split(
            " | "
        )


def _broadcasting(signature: Signature) -> Callable[..., Any]:
    """The formula, its arguments checked: arrays are broadcast, small vectors pass straight
    through.
    """
    formula, at, promised = signature.formula, signature.space_at, signature.promise

    @functools.wraps(formula)
    def method(self: Any, *args: Any, **options: Any) -> Any:
        if options:
            return _checked(signature, self, args, options)
        for value, types in zip(args, signature.trusted):
            if types is not None and type(value) not in types:
                return _checked(signature, self, args, options)
        if at is None or at < len(args):
            space = self if at is None else args[at]
            try:
                shapes = space._shapes[signature]
            except (AttributeError, KeyError):
                shapes = signature.shapes(space)
            for value, shape in zip(args, shapes):
                if shape is not None and value is not None:
                    found = len(value) if type(value) is Vec else value.shape
                    if found != shape:
                        return _checked(signature, self, args, options)
        try:
            try:
                result = formula(self, *args)
            except CarriesMore:
                result = _CARRIES_MORE
            if result is _CARRIES_MORE:  # what is raised here is not raised because of that
                result = taking_all(formula)(self, *args)
        except Exception as error:
            _blame(signature, self, args, error)
            raise
        return signature.kept(self, result) if promised else result

    method.__formula__ = formula  # type: ignore[attr-defined]
    method.__promise__ = promised  # type: ignore[attr-defined]
    return method


_CARRIES_MORE = object()
"""In place of a result: the formula took a function of Python's `math` of a number that carries more."""


def bare(method: Any) -> Any:
    """The formula behind a method that broadcasts; anything else is what it is."""
    formula = getattr(method, "__formula__", method)  # which a decorator may have copied
    return formula if formula is getattr(method, "__wrapped__", method) else method


# ------------------------------------------------------------------ arguments


def _checked(
    signature: Signature, owner: Any, args: tuple[Any, ...], options: dict[str, Any]
) -> Any:
    """The method with every argument converted and checked."""
    formula, arguments = signature.formula, signature.bound(args, options)
    if arguments is None:
        # a TypeError of Python's own: the number of arguments, or their names
        return formula(owner, *args, **options)
    where = f"{type(owner).__name__}.{signature.name}"
    for name, value in arguments.items():
        if name not in signature.kinds:  # a float too, where there is no vector beside it
            arguments[name] = _option(signature, owner, where, name, value)
    space = arguments.get("group", arguments.get("action", owner))  # who knows the shapes
    absent = [
        name
        for name in signature.kinds
        if arguments.get(name, 0) is None and signature.optional(name)
    ]
    numbers = [name for name in arguments if name in signature.kinds and name not in absent]
    for name, value in arguments.items():
        if signature.classes.get(name) in _ARRAYS:
            arguments[name] = _whole_array(signature, space, where, name, value)
        elif name not in numbers:
            if not isinstance(value, np.ndarray):
                _refuse(space, where, name, value)
            if signature.classes.get(name) == "str" and not isinstance(value, str):
                raise InvalidType(f"{where}: {name} must be a string; got {shown(value)}")
    if all(_is_small(arguments[name], signature.kinds[name]) for name in numbers):
        for name in numbers:
            if signature.kinds[name] == "float":
                arguments[name] = _number(where, name, arguments[name])
        return _small(signature, owner, space, where, arguments)
    return _broadcast(signature, owner, space, where, arguments, numbers)


def _option(signature: Signature, owner: Any, where: str, name: str, value: Any) -> Any:
    """An argument that is no number of a formula: a record, a whole number, a choice by name."""
    text = signature.classes.get(name, "").removesuffix(" | None")
    if value is None and signature.optional(name):
        return value
    if text in _records:
        if not any(base.__name__ == text for base in type(value).__mro__):
            raise InvalidType(
                f"{where}: {name} must {_records[text]._wanted(owner)}; got {shown(value)}"
            )
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


def _whole(value: Any) -> int:
    if isinstance(value, (bool, np.bool_)):
        raise TypeError
    return operator.index(value)


def _truth(value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError
    return bool(value)


def _mapping(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise TypeError
    return value


def _generator(value: Any) -> Any:
    """What makes a generator of random numbers, as it came."""
    known = (np.random.Generator, np.random.BitGenerator, np.random.SeedSequence)
    if not isinstance(value, known) and (value := _whole(value)) < 0:
        raise ValueError
    return value


def _axes(value: Any) -> tuple[int, ...]:
    """Leading axes: one number or several."""
    axes = tuple(map(_whole, value)) if isinstance(value, (tuple, list)) else (_whole(value),)
    if not all(0 <= n < 2**31 for n in axes) or math.prod(axes) >= 2**31:
        raise ValueError
    return axes


_OPTIONS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "int": ("a whole number", _whole),
    "bool": ("True or False", _truth),
    "dict": ("a dict", _mapping),
    "Generator | int": (
        "a seed, a whole number from 0 on, or a numpy.random.Generator",
        _generator,
    ),
    "int | tuple": (
        "a whole number from 0 on, or several as a tuple, below 2**31 altogether",
        _axes,
    ),
}
"""What other arguments must be, and what makes them so, by annotation."""


_ARRAYS = ("ndarray", "ArrayLike")
"""What a method annotates that takes arrays itself: one, shaped like an element, or elements with
any leading axes.
"""


def _whole_array(signature: Signature, space: Any, where: str, name: str, value: Any) -> np.ndarray:
    """An argument of a method that takes arrays itself."""
    array, shape = (
        real_array(value, f"{where}: {name}", space._complex("Element")),
        space._shape(name, "Element"),
    )
    many = signature.classes[name] == "ArrayLike"
    leading = array.shape[: max(array.ndim - len(shape), 0)] if many else ()
    if array.shape != leading + shape:
        raise InvalidInput(
            f"{where}: {name} has shape {array.shape}; "
            f"it{'s last axes' if many else ''} must be {shape}"
        )
    if many:
        rows = Batch(
            signature.formula,
            None,
            {name: _flattened(array, leading, shape)},
            {},
            (name,),
            space,
            where,
            leading,
        )
        for i in range(len(rows)):
            rows.check(i)
    return array


def _is_small(value: Any, kind: str) -> bool:
    """Is it what formulas hand to each other, a number or a small vector?"""
    if kind != "float":
        return isinstance(value, (Vec, Mat))
    if isinstance(value, (int, float, np.integer, np.floating)):
        return not isinstance(value, bool)
    # series, symbols
    return (
        isinstance(value, (StandIn, Pair))
        or hasattr(value, "elementary")
        or hasattr(value, "free_symbols")
    )


def _number(where: str, name: str, value: Any) -> Any:
    """A real number as a float; what stands for one as it is."""
    if not isinstance(value, (int, float, np.integer, np.floating)):
        return value
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidInput(f"{where}: {name} is {shown(value)}; it must be finite, and as a float")
    return number


def _small(
    signature: Signature, owner: Any, space: Any, where: str, arguments: dict[str, Any]
) -> Any:
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
                raise InvalidInput(
                    f"{where}: {name} has no {error.args[0]!r}; got {shown(value)}"
                ) from error
        raise


def _blame(signature: Signature, owner: Any, args: tuple[Any, ...], error: Exception) -> None:
    """Raise what is wrong with small vectors for which a formula failed; return if it is not their
    shape.
    """
    arguments = signature.bound(args, {})
    if arguments is not None:
        if isinstance(error, AttributeError):
            owner._explain(arguments)
        space, where = (
            arguments.get("group", arguments.get("action", owner)),
            f"{type(owner).__name__}.{signature.name}",
        )
        try:
            _check_shapes(signature, space, where, arguments)
            for name, value in arguments.items():
                if type(value) in (int, str):
                    _refuse(space, where, name, value)
        except InvalidInput as reason:
            raise reason from error


def _check_shapes(signature: Signature, space: Any, where: str, arguments: dict[str, Any]) -> None:
    for name, kind in signature.kinds.items():
        value = arguments.get(name)
        if isinstance(value, (Vec, Mat)):
            shape = space._shape(name, kind)
            found = (len(value),) if isinstance(value, Vec) else value.shape
            if shape is not None and found != shape:
                raise InvalidInput(f"{where}: {name} has shape {found}; it must be {shape}")


def _broadcast(
    signature: Signature,
    owner: Any,
    space: Any,
    where: str,
    arguments: dict[str, Any],
    numbers: list[str],
) -> Any:
    """The formula on arrays: shapes, numbers and membership are checked, leading axes broadcast."""
    kinds = signature.kinds
    arrays: dict[str, np.ndarray] = {}
    lead: dict[str, tuple[int, ...]] = {}
    for name in numbers:
        kind, value = kinds[name], arguments[name]
        array = real_array(value, f"{where}: {name}", space._complex(kind))
        shape = () if kind == "float" else space._shape(name, kind)
        axes = AXES.get(kind, 0) if shape is None else len(shape)
        core = array.shape[array.ndim - axes :] if axes else ()
        if array.ndim < axes or (shape is not None and core != shape):
            expected, got = (
                shape if shape is not None else ("n",) * axes,
                "" if array.ndim else f"; got {shown(value)}",
            )
            raise InvalidInput(
                f"{where}: {name} has shape {array.shape}; its last axes must be {expected}{got}"
            )
        arrays[name], lead[name] = array, array.shape[: array.ndim - axes]
    try:
        leads = {*lead.values()}
        leading = np.broadcast_shapes(*leads) if len(leads) > 1 else leads.pop()
    except ValueError:
        raise InvalidInput(f"{where}: the leading axes {lead} do not broadcast") from None
    rest = {k: v for k, v in arguments.items() if k not in arrays}
    flat = {k: _flattened(a, leading, a.shape[len(lead[k]) :]) for k, a in arrays.items()}
    elements = tuple([name for name in arrays if kinds[name] == "Element"])
    promise = signature if signature.promise else None
    batch = Batch(signature.formula, owner, flat, rest, elements, space, where, leading, promise)
    if not math.prod(leading):  # an element of the right shape tells the shape of nothing
        some = {k: _some(space, kinds[k], a.shape[1:])[None] for k, a in flat.items()}
        one = dataclasses.replace(batch, arrays=some, leading=(1,))
        return _unflattened(_none_of(_stacked([one.row(0)], where)), leading)
    if owner.is_large:
        results = batch.in_numpy()
        if results is not None:
            return _unflattened(results, leading)
    return _unflattened(evaluate_rows(batch), leading)


def _refuse(space: Any, where: str, name: str, value: Any, shown: str | None = None) -> None:
    objection = space._objection(name, value)
    if objection:
        raise InvalidInput(f"{where}: {shown or name} {objection}")


# ------------------------------------------------------------------ rows


@dataclasses.dataclass(frozen=True)
class Batch:
    """A formula and many rows of its arguments."""

    formula: Callable[..., Any]
    owner: Any
    arrays: dict[str, np.ndarray]
    """The arguments that differ, each (n, ...); a stride of zero means one row for all."""
    rest: dict[str, Any]
    """The other arguments."""
    elements: tuple[str, ...]
    """The names of those arrays that must be elements of the group."""
    space: Any
    where: str
    leading: tuple[int, ...]
    promise: Signature | None = None
    """What the results must be, if somebody said so."""

    def __len__(self) -> int:
        return math.prod(self.leading)

    @property
    def group(self) -> Any:
        """Who knows what an element is: the group itself, or that of a system or an action."""
        return _who_knows_elements(self.space)

    def row(self, i: int) -> Any:
        """The formula for row i in plain Python.  Raises what is wrong with its arguments, and what
        the formula raises.
        """
        self.check(i)
        try:
            value = self.formula(self.owner, **row_of(self.arrays, i), **self.rest)
            return value if self.promise is None else self.promise.kept(self.owner, value)
        except AttributeError:
            self.owner._explain(self.rest)
            raise
        except (ZeroDivisionError, OverflowError) as error:
            raise InvalidInput(
                f"{self.where} has no finite value at {self.at(i)}: {error}"
            ) from error

    def check(self, i: int) -> None:
        """Refuse a row with numbers that are not finite, or with an array that is no element of the
        group.
        """
        for name, array in self.arrays.items():
            if not np.isfinite(array[i]).all():
                at = list(map(int, np.unravel_index(i, self.leading))) if array.strides[0] else []
                where = np.argwhere(~np.isfinite(array[i]))[0]
                entry = [*at, *map(int, where)]
                value = array[i][tuple(where)]
                raise InvalidInput(
                    f"{self.where}: {name}{entry or ''} is {value}; every entry must be finite"
                )
        for name in self.elements:
            array = self.arrays[name]
            if (array.strides[0] or not i) and not _is_element(self.group, array[i]):
                row = list(map(int, np.unravel_index(i, self.leading))) if array.strides[0] else []
                _refuse(self.space, self.where, name, array[i], f"{name}{row or ''}")

    def stacked(self, values: Sequence[Any], rows: Sequence[int]) -> Any:
        """The values of these rows as arrays, the batch axis first; what is not finite is refused."""
        results = _stacked(values, self.where)
        bad = _first_not_finite(results)
        if bad is not None:
            raise InvalidInput(f"{self.where} has no finite value at {self.at(rows[bad])}")
        return results

    def at(self, i: int) -> str:
        return ", ".join(f"{name} = {shown(a[i].tolist())}" for name, a in self.arrays.items())

    def in_numpy(self) -> Any:
        """The method on whole arrays, if its owner knows how."""
        for i in range(len(self)):
            self.check(i)
        with np.errstate(all="ignore"):
            results = self.owner._in_numpy(self.formula.__name__, self.arrays | self.rest)
        bad = None if results is None else _first_not_finite(results)
        if bad is not None:
            raise InvalidInput(f"{self.where} has no finite value at {self.at(bad)}")
        return results


def in_python(batch: Batch) -> Any:
    """The formula for one row after the other."""
    rows = range(len(batch))
    return batch.stacked([batch.row(i) for i in rows], rows)


evaluate_rows: Callable[[Batch], Any] = in_python
"""How the rows of a batch are evaluated.  The package, which knows the compiler too, puts another
evaluator here.
"""


def row_of(arrays: dict[str, np.ndarray], i: int) -> dict[str, Any]:
    """The arguments number i, as small vectors and plain floats."""
    return {name: small(a[i]) for name, a in arrays.items()}


def small(array: np.ndarray) -> Any:
    """An array without a batch axis as a formula takes it: a float, a `Vec` or a `Mat`."""
    return _SMALL[array.ndim](array.tolist())


_SMALL: tuple[Callable[..., Any], ...] = float, Vec.of, Mat.of


def _is_element(group: Any, array: np.ndarray) -> bool:
    """Told from the defect, as in native code."""
    if group.is_large:
        return False  # ask for its objection, which is computed in NumPy
    try:
        return bool(group.defect(small(array)) <= MEMBERSHIP)
    except ArithmeticError:
        return False


def _some(space: Any, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """An argument of this kind on which every formula has a value."""
    if kind in ("Element", "Ambient"):
        return np.array(_who_knows_elements(space).identity())
    return np.eye(*shape) if len(shape) == 2 else np.zeros(shape)


def _who_knows_elements(space: Any) -> Any:
    """The group itself, or that of a system or an action."""
    return space if hasattr(space, "identity") or not hasattr(space, "group") else space.group


def _first_not_finite(results: Any) -> int | None:
    """The first row with an infinity or a nan."""
    if isinstance(results, tuple):
        found = [i for part in results if (i := _first_not_finite(part)) is not None]
        return min(found) if found else None
    finite = np.isfinite(results)
    return None if finite.all() else int(np.argmin(finite.reshape(len(results), -1).all(axis=1)))


def _none_of(one: Any) -> Any:
    return tuple(map(_none_of, one)) if isinstance(one, tuple) else one[:0]


def _flattened(array: np.ndarray, leading: tuple[int, ...], core: tuple[int, ...]) -> np.ndarray:
    """The leading axes as one; an array that is the same for all rows is not copied: its stride is
    zero.
    """
    if array.shape == leading + core and len(leading) == 1:
        return array
    if math.prod(array.shape) == math.prod(core) and math.prod(leading) != 1:
        return np.broadcast_to(array.reshape(core), (math.prod(leading), *core))
    return np.broadcast_to(array, leading + core).reshape(math.prod(leading), *core)


def _unflattened(result: Any, leading: tuple[int, ...]) -> Any:
    if isinstance(result, tuple):
        return tuple(_unflattened(part, leading) for part in result)
    shaped = result.reshape(leading + result.shape[1:])
    return shaped if shaped.ndim else shaped.item()


def _real(value: Any) -> Any:
    """What a formula gives: a power of a negative number, complex in Python, is no number here, as
    in native code.
    """
    if type(value) is complex:
        return math.nan
    if isinstance(value, Vec) and any(type(x) is complex for x in value):
        return Vec(*map(_real, value))
    if isinstance(value, Mat) and any(type(x) is complex for row in value.rows for x in row):
        return Mat(*[[_real(x) for x in row] for row in value.rows])
    return value


def _no_value(where: str, value: Any) -> str:
    if hasattr(type(value), "__dataclass_fields__"):  # which formulas only can ask for
        return (
            f"{where} was given a NumPy array: the formula that it comes from gives one where a "
            "vector belongs; write liemech.vec(...) for np.array([...]), liemech.vec(*B) * x for B * x"
        )
    return f"{where} gave {shown(value)}; a formula gives numbers, vectors, matrices or tuples of these"


def _stacked(results: Sequence[Any], where: str) -> Any:
    """The values of a formula as arrays, the batch axis first; tuples of values as tuples of
    arrays.
    """
    first = results[0]
    if isinstance(first, tuple) and not isinstance(first, Vec):
        return tuple(_stacked(list(part), where) for part in zip(*results, strict=True))
    if all(isinstance(one, bool) for one in results):
        return np.array(results)
    results = [_real(one) for one in results]
    for one in results:
        if not isinstance(one, (float, int, Complex, Vec, Mat, np.ndarray, np.number)):
            raise InvalidType(_no_value(where, one))
    try:
        return np.array(results, dtype=float)
    except ValueError:
        raise InvalidType(f"{_no_value(where, first)}, of one shape") from None
    except TypeError:  # complex entries among them
        return np.array(results, dtype=complex)
