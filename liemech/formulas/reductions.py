"""NumPy's sums, extremes and rearrangements of vectors and matrices, as formulas: sums and products
are added up from left to right, of a matrix row by row.

NumPy adds eight sums side by side and leaves products of matrices to BLAS; the formulas have one
order, in plain Python and in native code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import InvalidType
from .functions import sqrt, where
from .vectors import Mat, Vec, dot, mat, sum, vec


def _reduced(function: Callable[[Any], Any], x: Any, axis: Any) -> Any:
    """A function of several numbers, of all components, or of those along an axis of a matrix."""
    if not isinstance(x, Mat):
        if axis not in (None, 0, -1):
            raise InvalidType(f"axis {axis} of a vector, which has one axis, 0")
        return function(x)
    if axis is None:
        return function([entry for row in x for entry in row])
    if axis in (0, -2):
        return vec(*[function(column) for column in x.T])
    if axis in (1, -1):
        return vec(*[function(row) for row in x])
    raise InvalidType(f"axis {axis} of a matrix, which has the axes 0 and 1")


def larger(x: Any, y: Any) -> Any:
    """The larger number; nan if one is nan."""
    return where(x < y, y, where(y != y, y, x))


def smaller(x: Any, y: Any) -> Any:
    """The smaller number; nan if one is nan."""
    return where(y < x, y, where(y != y, y, x))


def _extreme(of_two: Callable[[Any, Any], Any], items: Any) -> Any:
    extreme = items[0]
    for x in items[1:]:
        extreme = of_two(extreme, x)
    return extreme


def _multiplied(items: Any) -> Any:
    product = 1.0
    for x in items:
        product = product * x
    return product


def total(x: Any, axis: Any = None) -> Any:
    """The sum of all components, or along an axis."""
    return _reduced(sum, x, axis)


def largest(x: Any, axis: Any = None) -> Any:
    """The largest component, or of each column (axis 0) or row (axis 1); nan if one is nan."""
    return _reduced(lambda items: _extreme(larger, items), x, axis)


def smallest(x: Any, axis: Any = None) -> Any:
    """The smallest component; nan if one is nan."""
    return _reduced(lambda items: _extreme(smaller, items), x, axis)


def mean(x: Any, axis: Any = None) -> Any:
    """The sum over the number of components."""
    return _reduced(lambda items: sum(items) / len(items), x, axis)


def product(x: Any, axis: Any = None) -> Any:
    """The product of all components."""
    return _reduced(_multiplied, x, axis)


def length(x: Any) -> Any:
    """The Euclidean length of a vector, the Frobenius norm of a matrix: the root of the sum of all squares."""
    return sqrt(sum([a * a for a in _all(x)]))


def every(x: Any) -> Any:
    """Whether all components are true."""
    return all(_all(x))


def some(x: Any) -> Any:
    """Whether some component is true."""
    return any(_all(x))


def trace(x: Any) -> Any:
    """x_11 + x_22 + ..."""
    return sum(diagonal_of(x))


def diagonal_of(x: Any) -> Vec:
    """The entries x_11, x_22, ... of a matrix."""
    return vec(*[x[i][i] for i in range(min(len(x), len(x[0])))])


def diagonal_matrix(x: Any) -> Any:
    """The diagonal matrix of a vector; the vector of the diagonal of a matrix."""
    if isinstance(x, Mat):
        return diagonal_of(x)
    return mat(*[[x[i] if i == j else 0.0 * x[i] for j in range(len(x))] for i in range(len(x))])


def _all(x: Any) -> Any:
    """The list of all components, row by row."""
    return [entry for row in x for entry in row] if isinstance(x, Mat) else [*x]


def flat(x: Any) -> Vec:
    """The vector of all components, row by row."""
    return vec(*_all(x))


def copy(x: Any) -> Any:
    """The vector or matrix itself, which nothing changes."""
    return x


def like(x: Any, value: float) -> Any:
    """A vector or matrix of the shape of x whose components all have one value."""
    if isinstance(x, Mat):
        return mat(*[[value for _ in row] for row in x])
    return vec(*[value for _ in x])


def zeros_like(x: Any) -> Any:
    """Zeros, in the shape of x."""
    return like(x, 0.0)


def ones_like(x: Any) -> Any:
    """Ones, in the shape of x."""
    return like(x, 1.0)


def rolled(x: Any, shift: int) -> Vec:
    """The components moved on by `shift` places, the last ones to the front."""
    n = len(x)
    return vec(*[x[(i - shift) % n] for i in range(n)])


def differences(x: Any) -> Vec:
    """x_2 - x_1, x_3 - x_2, ..."""
    return vec(*[x[i + 1] - x[i] for i in range(len(x) - 1)])


def concatenated(parts: Any, axis: int = 0) -> Any:
    """Vectors one behind the other, or matrices below (axis 0) or beside (axis 1) each other."""
    if not any(isinstance(part, Mat) for part in parts):
        return vec(*[a for part in parts for a in part])
    if axis == 0:
        return mat(*[row for part in parts for row in part])
    return mat(*[[a for part in parts for a in part[i]] for i in range(len(parts[0]))])


def beside(parts: Any) -> Any:
    """Vectors one behind the other, matrices beside each other."""
    vectors = [part if isinstance(part, (Vec, Mat)) else vec(part) for part in parts]
    return concatenated(vectors, 1)


def below(parts: Any) -> Mat:
    """Vectors as rows, matrices below each other."""
    return mat(*[row for part in parts for row in (part if isinstance(part, Mat) else [part])])


def stacked(parts: Any, axis: int = 0) -> Any:
    """Vectors as the rows (axis 0) or the columns (axis 1) of a matrix, numbers as a vector."""
    if not isinstance(parts[0], Vec):
        return vec(*parts)
    rows = mat(*parts)
    return rows if axis == 0 else rows.T


def kronecker(a: Any, b: Any) -> Any:
    """The Kronecker product, (a_ij b_kl); of vectors (a_i b_j)."""
    if not isinstance(a, Mat):
        return vec(*[x * y for x in a for y in b])
    return mat(*[[x * y for x in row for y in other] for row in a for other in b])


def einsum(subscripts: str, *operands: Any) -> Any:
    """Sums of products by Einstein's convention, `einsum("ij,j->i", A, u)`: over the indices that
    the result has not, in the order of the alphabet, the last one of them changing first.

    Raises InvalidType for a result of more than two axes.
    """
    inputs, *results = subscripts.replace(" ", "").split("->")
    letters = inputs.split(",")
    every = [k for k in "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz" if k in inputs]
    out = results[0] if results else "".join([k for k in every if inputs.count(k) == 1])
    if len(out) > 2 or [len(names) for names in letters] != [len(x.shape) for x in operands]:
        raise InvalidType(f"einsum: {subscripts!r} does not fit its operands, or its result has more than two axes")
    summed = "".join([k for k in every if k not in out])
    sizes = [_reach(name, letters, operands) for name in out + summed]
    inner = _places(sizes[len(out) :])
    entries = [
        sum([_term(letters, operands, out + summed, [*index, *place]) for place in inner])
        for index in _places(sizes[: len(out)])
    ]
    if len(out) < 2:
        return vec(*entries) if out else entries[0]
    n = sizes[1]
    return mat(*[entries[i * n : (i + 1) * n] for i in range(sizes[0])])


def _reach(index: str, letters: Any, operands: Any) -> int:
    """The number of values that an index runs through."""
    lengths = [n for names, x in zip(letters, operands) for name, n in zip(names, x.shape) if name == index]
    if [n for n in lengths if n != lengths[0]]:
        raise InvalidType(f"einsum: the index {index} runs to {lengths[0]} and farther")
    return lengths[0]


def _places(sizes: Any) -> Any:
    """The values of some indices, all combinations, the last one changing first."""
    places: Any = [[]]
    for n in sizes:
        places = [[*place, i] for place in places for i in range(n)]
    return places


def _term(letters: Any, operands: Any, indices: str, place: Any) -> Any:
    """The product of one entry of each operand."""
    product: Any = None
    for names, x in zip(letters, operands):
        entry = x
        for name in names:
            entry = entry[place[indices.index(name)]]
        product = entry if product is None else product * entry
    return product


def contracted(a: Any, b: Any, axes: Any = 2) -> Any:
    """The sum over the last `axes` axes of a and the first of b: 0 the outer product of vectors, 1
    the matrix product, 2 the sum of all products of entries.
    """
    if axes == 2 and isinstance(a, Mat):
        return sum([dot(p, q) for p, q in zip(a, b)])
    if axes == 1:
        return a @ b
    raise InvalidType(f"tensordot of axes {axes!r}: write it as np.einsum, or with loops")


def interpolated(x: Any, nodes: Any, values: Any) -> Any:
    """The straight line between the values at the two nodes around x; beyond the nodes the first or
    the last value.

    slope = (v_k+1 - v_k)/(x_k+1 - x_k),  slope (x - x_k) + v_k, as NumPy rounds it.
    """
    y = where(x < nodes[0], values[0], values[len(nodes) - 1])
    for k in range(len(nodes) - 1):
        slope = (values[k + 1] - values[k]) / (nodes[k + 1] - nodes[k])
        line = slope * (x - nodes[k]) + values[k]
        y = where(x >= nodes[k], where(x < nodes[k + 1], line, y), y)
    return where(x != x, x, y)


def place(nodes: Any, x: Any, side: str = "left") -> Any:
    """The count of increasing numbers below x; with side="right", not above it.  All are below nan."""
    count = 0
    for a in nodes:
        below = a < x if side == "left" else a <= x
        count = count + (below | (x != x))
    return count
