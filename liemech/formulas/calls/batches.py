"""Batches: a formula for many rows of its arguments, leading axes broadcast as NumPy's are.

Plain Python computes one row after the other; the compiler takes several together.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType
from ..arrays import check_finite, real_array, shown
from ..classes.frozen import frozen
from ..classes.signatures import Signature
from ..large import Large
from ..numbers.complex_numbers import Complex
from ..vectors import Mat, Vec, small

MEMBERSHIP = 1e-6
"""Arrays whose `defect` is larger are no elements with rounding errors but mistakes, and are refused."""

AXES = {"float": 0, "Vec": 1, "Mat": 2}
"""How many axes a number, a vector and a matrix have."""


def broadcast(
    signature: Signature, owner: Any, space: Any, where: str, arguments: dict[str, Any], numbers: list[str]
) -> Any:
    """The formula on arrays: shapes, numbers and membership are checked, leading axes broadcast."""
    kinds = signature.kinds
    arrays: dict[str, np.ndarray] = {}
    lead: dict[str, tuple[int, ...]] = {}
    reshaped = False
    for name in numbers:
        kind, value = kinds[name], arguments[name]
        if kind != "float":
            as_given, value = value, space._in_rows(value, kind)
            reshaped = reshaped or value is not as_given
        array = real_array(value, f"{where}: {name}", space._complex(kind))
        shape = () if kind == "float" else space._shape(name, kind)
        axes = AXES.get(kind, 0) if shape is None else len(shape)
        core = array.shape[array.ndim - axes :] if axes else ()
        if array.ndim < axes or (shape is not None and core != shape):
            expected = ("n",) * axes if shape is None else shape
            got = "" if array.ndim else f"; got {shown(value)}"
            raise InvalidInput(f"{where}: {name} has shape {array.shape}; its last axes must be {expected}{got}")
        arrays[name], lead[name] = array, array.shape[: array.ndim - axes]
    try:
        leads = {*lead.values()}
        leading = np.broadcast_shapes(*leads) if len(leads) > 1 else leads.pop()
    except ValueError:
        raise InvalidInput(f"{where}: the leading axes {lead} do not broadcast") from None
    others = {k: v for k, v in arguments.items() if k not in arrays}
    flat = {k: _flattened(a, leading, a.shape[len(lead[k]) :]) for k, a in arrays.items()}
    elements = tuple([name for name in arrays if kinds[name] == "Element"])
    promise = signature if signature.promise else None
    batch = Batch(signature.formula, owner, flat, others, elements, space, where, leading, promise)
    if not math.prod(leading):  # an element of the right shape tells the shape of nothing
        examples = {k: _some(space, kinds[k], a.shape[1:])[None] for k, a in flat.items()}
        single = dataclasses.replace(batch, arrays=examples, leading=(1,))
        results = none_of(stacked([single.row(0)], where))
    else:
        results = batch.in_numpy() if owner.is_large else None
        results = evaluate_rows(batch) if results is None else results
    results = unflattened(results, leading)
    return reshaped_as_given(results, space) if reshaped else results


def refuse(space: Any, where: str, name: str, value: Any, shown: str | None = None) -> None:
    """Raise InvalidInput if the space objects to an argument."""
    objection = space._objection(name, value)
    if objection:
        raise InvalidInput(f"{where}: {shown or name} {objection}")


def check_elements(space: Any, where: str, name: str, array: np.ndarray, leading: tuple[int, ...]) -> None:
    """Raise InvalidInput if one of many arrays is no element of the group."""
    rows = {name: _flattened(array, leading, array.shape[len(leading) :])}
    batch = Batch(None, None, rows, {}, (name,), space, where, leading)
    for i in range(len(batch)):
        batch.check(i)


# ------------------------------------------------------------------ rows


@frozen
class Batch:
    """A formula and many rows of its arguments."""

    formula: Any
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
    """The signature whose promise the results must keep, if there is one."""

    def __len__(self) -> int:
        return math.prod(self.leading)

    @property
    def group(self) -> Any:
        """The group whose elements are meant: the space itself, or that of a system or an action."""
        return who_knows_elements(self.space)

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
            raise InvalidInput(f"{self.where} has no finite value at {self.at(i)}: {error}") from error

    def check(self, i: int) -> None:
        """Refuse a row with numbers that are not finite, or with an array that is no element of the group."""
        for name, array in self.arrays.items():
            if not np.isfinite(array[i]).all():
                check_finite(array[i], f"{self.where}: {name}", self._leading(array, i))
        for name in self.elements:
            array = self.arrays[name]
            if (array.strides[0] or not i) and not _is_element(self.group, array[i]):
                at = f"{name}{[*self._leading(array, i)] or ''}"
                refuse(self.space, self.where, name, array[i], at)

    def _leading(self, array: np.ndarray, i: int) -> tuple[int, ...]:
        """The leading indices of a row, as the caller counts them; none of what all rows share."""
        return tuple(map(int, np.unravel_index(i, self.leading))) if array.strides[0] else ()

    def stacked(self, values: Sequence[Any], rows: Sequence[int]) -> Any:
        """The values of these rows as arrays, the batch axis first; what is not finite is refused."""
        return self._finite(stacked(values, self.where), rows)

    def in_numpy(self) -> Any:
        """The method on whole arrays, if its owner knows how."""
        rows = range(len(self))
        for i in rows:
            self.check(i)
        with np.errstate(all="ignore"):
            results = self.owner._in_numpy(self.formula.__name__, self.arrays | self.rest)
        return None if results is None else self._finite(results, rows)

    def _finite(self, results: Any, rows: Sequence[int]) -> Any:
        bad = first_not_finite(results)
        if bad is not None:
            raise InvalidInput(f"{self.where} has no finite value at {self.at(rows[bad])}")
        return results

    def at(self, i: int) -> str:
        """The arguments of row i, for a message."""
        return ", ".join(f"{name} = {shown(a[i].tolist())}" for name, a in self.arrays.items())


def in_python(batch: Batch) -> Any:
    """The formula for one row after the other."""
    rows = range(len(batch))
    return batch.stacked([batch.row(i) for i in rows], rows)


evaluate_rows: Callable[[Batch], Any] = in_python
"""How the rows of a batch are evaluated.  The package, which knows the compiler too, puts another evaluator here."""


def row_of(arrays: dict[str, np.ndarray], i: int) -> dict[str, Any]:
    """The arguments number i, as small vectors and plain floats."""
    return {name: _SMALL[a.ndim](a[i].tolist()) for name, a in arrays.items()}


_SMALL: tuple[Any, ...] = None, float, Vec.of, Mat.of
"""By the axes of an array, how a formula takes a row of it."""


def _is_element(group: Any, array: np.ndarray) -> bool:
    """Whether a row is an element, told from its defect as in native code."""
    if group.is_large:
        return False  # ask for its objection, which is computed in NumPy
    try:
        return bool(group.defect(small(array)) <= MEMBERSHIP)
    except ArithmeticError:
        return False


def _some(space: Any, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """An argument of this kind on which formulas have a value: of vectors not zero, where attractions have poles."""
    if kind in ("Element", "Ambient"):
        identity = np.array(who_knows_elements(space).identity())
        if identity.shape == shape:  # a measurement is a vector, or an element
            return identity
    return np.eye(*shape) if len(shape) == 2 else np.linspace(0.25, 0.75, math.prod(shape)).reshape(shape)


def who_knows_elements(space: Any) -> Any:
    """The group itself, or that of a system or an action."""
    return space if hasattr(space, "identity") or not hasattr(space, "group") else space.group


def _flattened(array: np.ndarray, leading: tuple[int, ...], core: tuple[int, ...]) -> np.ndarray:
    """The leading axes as one; an array that is the same for all rows is not copied: its stride is zero."""
    if array.shape == leading + core and len(leading) == 1:
        return array
    if math.prod(array.shape) == math.prod(core) and math.prod(leading) != 1:
        return np.broadcast_to(array.reshape(core), (math.prod(leading), *core))
    return np.broadcast_to(array, leading + core).reshape(math.prod(leading), *core)


# ------------------------------------------------------------------ results


def none_of(results: Any) -> Any:
    """The results without their rows."""
    return tuple(map(none_of, results)) if isinstance(results, tuple) else results[:0]


def first_not_finite(results: Any) -> int | None:
    """The first row with an infinity or a nan."""
    if isinstance(results, tuple):
        rows = [i for part in results if (i := first_not_finite(part)) is not None]
        return min(rows) if rows else None
    finite = np.isfinite(results)
    return None if finite.all() else int(np.argmin(finite.reshape(len(results), -1).all(axis=1)))


def unflattened(results: Any, leading: tuple[int, ...]) -> Any:
    """The results with these leading axes in place of one; a single number unchanged."""
    if isinstance(results, tuple):
        return tuple([unflattened(part, leading) for part in results])
    array = results.reshape(leading + results.shape[1:])
    return array if array.ndim else array.item()


def reshaped_as_given(results: Any, space: Any) -> Any:
    """The results in the shape in which the arguments came."""
    if isinstance(results, tuple):
        return tuple([reshaped_as_given(part, space) for part in results])
    return space._out_of_rows(results) if isinstance(results, np.ndarray) else results


def _real(value: Any) -> Any:
    """A value of a formula: a power of a negative number, complex in Python, is no number here, as in native code."""
    if type(value) is complex:
        return math.nan
    if isinstance(value, Vec) and any(type(x) is complex for x in value):
        return Vec(*map(_real, value))
    if isinstance(value, Mat) and any(type(x) is complex for row in value.rows for x in row):
        return Mat(*map(_real, value.rows))
    return value


def _no_value(where: str, value: Any) -> str:
    if dataclasses.is_dataclass(type(value)):  # which formulas only can ask for
        return (
            f"{where} was given a NumPy array: the formula that it comes from gives one where a "
            "vector belongs; write liemech.vec(...) for np.array([...]), liemech.vec(*B) * x for B * x"
        )
    return f"{where} gave {shown(value)}; a formula gives numbers, vectors, matrices or tuples of these"


def stacked(results: Sequence[Any], where: str) -> Any:
    """The values of a formula as arrays, the batch axis first; tuples of values as tuples of arrays."""
    first = results[0]
    if isinstance(first, tuple) and not isinstance(first, Vec):
        return tuple(stacked(list(part), where) for part in zip(*results, strict=True))
    if all(isinstance(row, bool) for row in results):
        return np.array(results)
    results = [_real(row) for row in results]
    for row in results:
        if not isinstance(row, (float, int, Complex, Vec, Mat, Large, np.ndarray, np.number)):
            raise InvalidType(_no_value(where, row))
    try:
        return np.array(results, dtype=float)
    except ValueError:
        raise InvalidType(f"{_no_value(where, first)}, of one shape") from None
    except TypeError:  # complex entries among them
        return np.array(results, dtype=complex)
