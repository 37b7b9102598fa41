"""Parameters that have a value for each of many: edges, sites."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType
from ..arrays import check_finite, real_array
from ..tables import Table, entry
from ..vectors import mat, vec
from .fields import OfEach
from .records import Record, record


@record
class Each(Record, OfEach):
    """A number, a vector or a matrix for each of many edges or sites; `each` makes one.

    numbers : all of them, one value after the other.  shape : that of one value.
    """

    numbers: Any
    shape: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Raises InvalidInput unless the table is as long as values of this shape: native code does not look."""
        super().__post_init__()
        whole = all(type(n) is int and n > 0 for n in self.shape)
        if not (isinstance(self.numbers, Table) and len(self.shape) < 3 and whole and len(self.numbers)):
            raise InvalidInput(f"each: {self.numbers!r} has no values of shape {self.shape}; make it by `each`")
        if len(self.numbers) % math.prod(self.shape):
            raise InvalidInput(f"each: {len(self.numbers)} numbers are no values of shape {self.shape}")

    def __len__(self) -> int:
        return len(self.numbers) // (math.prod(self.shape) or 1)

    @property
    def values(self) -> np.ndarray:
        """The values of all edges or sites, (n, ...)."""
        numbers: np.ndarray = self.numbers.array
        return numbers.reshape(-1, *self.shape)

    def of(self, i: Any) -> Any:
        """The value number i, from 0."""
        if not self.shape:
            return entry(self.numbers, i)
        first, n = i * math.prod(self.shape), self.shape[-1]
        if len(self.shape) == 1:
            return vec(*[entry(self.numbers, first + k) for k in range(n)])
        return mat(*[vec(*[entry(self.numbers, first + j * n + k) for k in range(n)]) for j in range(self.shape[0])])

    def _refused(self, *beside: Any) -> Any:
        raise InvalidType(
            f"{self!r} stands where one value is needed: bodies with values of their own are a list of systems, "
            "lm.integrate([first, second], ...)"
        )

    __lt__ = __le__ = __gt__ = __ge__ = __float__ = _refused
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = __neg__ = (
        _refused
    )

    def __repr__(self) -> str:
        return f"each({len(self)} values{f' of shape {self.shape}' if self.shape else ''})"


def each(values: Any) -> Each:
    """A parameter with a value for each edge or site: `Exchange(each(J))`, `KineticEnergy(each(J))`.

    values : (n,) numbers, (n, dim) vectors or (n, k, l) matrices.  Raises InvalidInput for other
    shapes and entries that are not finite.
    """
    array = real_array(values, "each: values")
    if array.ndim not in (1, 2, 3) or not len(array):
        raise InvalidInput(
            f"each: values have a value for each edge or site, (n,), (n, dim) or (n, k, l); got shape {array.shape}"
        )
    check_finite(array, "each: values")
    return Each(Table(array.ravel()), array.shape[1:])
