"""Vectors and matrices beside arrays: every operation does what NumPy does, or is refused."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech import formulas as f
from liemech.formulas import Mat, Vec

VALUES: dict[str, Any] = {
    "u": [1.0, 2.0, 3.0], "v": [3.0, 1.0, 2.0], "w": [0.5, -2.0], "one": [4.0],
    "A": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]], "B": [[2.0, 0.5, 1.0], [0.0, 3.0, 1.0], [1.0, 1.0, 4.0]],
    "T": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.5]], "t": [[1.0, 2.0, 3.0]],
}  # fmt: skip
OURS = {name: Mat.of(x) if isinstance(x[0], list) else Vec.of(x) for name, x in VALUES.items()}
ARRAYS = {name: np.array(x) for name, x in VALUES.items()}
FORMULAS = {
    "dot": (lm.dot, np.dot), "cross": (lm.cross, np.cross), "outer": (lm.outer, np.outer), "norm": (lm.norm, np.linalg.norm),
    "solve": (f.solve, np.linalg.solve), "solve3": (f.solve3, np.linalg.solve), "inverse": (f.inverse, np.linalg.inv),
    "determinant": (f.determinant, np.linalg.det), "transpose": (f.transpose, np.transpose), "diagonal": (f.diagonal, np.diag),
    "where": (f.where, np.where), "total": (f.sum, lambda x: np.sum(x, axis=0)), "vec": (lm.vec, lambda *x: np.array(x)),
    "mat": (lm.mat, lambda *x: np.array(x)),
}  # fmt: skip
SCALARS = "2.0", "2", "True", "np.float64(2.0)", "np.array(2.0)", "1.5j"
ROWS = (
    "[1, 2, 3]",
    "(1.0, 2.0, 3.0)",
    "np.array([1.0, 2.0, 3.0])",
    "[1.0, 2.0]",
    "[u, v]",
    "np.ones((3, 3))",
    "None",
    "'u'",
)
OPERATORS = ["+", "-", "*", "/", "//", "%", "**", "@", "<", "<=", ">", ">=", "==", "!=", "&", "|", "^", "in"]


def expressions() -> Iterator[str]:
    for op in OPERATORS:
        for x, y in itertools.product(VALUES, VALUES):
            yield f"{x} {op} {y}"
        for x, y in itertools.product(VALUES, SCALARS + ROWS):
            yield f"{x} {op} {y}"
            yield f"{y} {op} {x}"
    for x in VALUES:
        for function in (
            "max",
            "min",
            "sum",
            "sorted",
            "any",
            "all",
            "abs",
            "round",
            "len",
            "bool",
            "not",
            "int",
            "float",
            "tuple",
            "+",
            "-",
            "~",
        ):
            yield f"{function}({x})"
        for function in ["norm", "inverse", "determinant", "transpose", "diagonal", "total"]:
            yield f"{function}({x})"
        for index in (
            "0",
            "-1",
            "7",
            "1.0",
            "True",
            "None",
            "...",
            ":",
            "1:",
            "::-1",
            "0,1",
            ":,0",
            "0,:",
            ":2,1:",
            "0,1,2",
            "[0,1]",
            "np.int64(1)",
            "np.array([True,False,True])",
            "True,False",
            "...,0",
            "None,:",
        ):
            yield f"{x}[{index}]"
        yield f"{x}.shape"
        yield f"{x}.T"
    for x, y in itertools.product([*VALUES, "2.0", "[1.0, 2.0, 3.0]"], repeat=2):
        for function in ("dot", "cross", "outer", "solve", "solve3", "max", "min", "divmod", "vec", "mat"):
            yield f"{function}({x}, {y})"
        yield f"dot(vec(1.0, 2.0, 3.0), {y})"
        for function in (
            "dot",
            "matmul",
            "inner",
            "outer",
            "add",
            "multiply",
            "divide",
            "power",
            "maximum",
            "less",
            "equal",
            "arctan2",
            "linalg.solve",
        ):
            yield f"np.{function}({x}, {y})"
    for comparison in ("u < v", "u == v", "u != v", "u > 1.5", "2.0 >= u", "A == B", "A != A", "u == u", "u == 1.0"):
        for form in (
            "bool({0})", "not ({0})", "1.0 if {0} else 2.0", "where({0}, 1.0, 2.0)", "np.where({0}, u, v)", "np.any({0})",
            "np.all({0})", "np.sum({0})", "({0}).any()", "({0}).all()", "({0}).sum()", "any({0})", "all({0})", "sum({0})",
            "({0}) + (v < u)", "({0}) - (v < u)", "({0}) * (v < u)", "({0}) & (v < u)", "({0}) | (v < u)", "-({0})", "~({0})",
            "2.0 * ({0})", "({0}) + 1.0", "({0}) + u", "u[{0}]", "max({0}, u)", "({0}) == (v < u)", "({0}) & True",
        ):  # fmt: skip
            yield form.format(comparison)


WHOLE = ("==", "!=", "in", "bool", "not", " if ", "max", "min", "sorted", "True")
"""NumPy refuses the truth of `u == v`; records and dictionaries of ours need it: are all equal?"""


def outcome(text: str, names: dict[str, Any], which: int) -> Any:
    functions = {name: pair[which] for name, pair in FORMULAS.items()}
    try:
        with np.errstate(all="ignore"):
            return eval(text, {"np": np} | functions | names)
    except RecursionError:
        raise
    except Exception as error:
        return error


def numbers(x: Any) -> np.ndarray:
    """As an array of floats or complex numbers, objects by their text."""
    try:
        array = np.asarray(x)
        if array.dtype.kind in "biufc":
            return array.astype(complex)
        return np.asarray(list(map(complex, array.ravel()))).reshape(array.shape)
    except (TypeError, ValueError):
        return np.asarray(repr(x))


@pytest.mark.filterwarnings("ignore")
def test_every_operation_is_numpys_or_refused() -> None:
    wrong = []
    several = 0
    for text in expressions():
        found, right = outcome(text, OURS, 0), outcome(text, ARRAYS, 1)
        if isinstance(found, Exception):
            assert isinstance(found, (TypeError, ValueError, IndexError, AttributeError, ZeroDivisionError)), text
            continue
        several += 1
        if isinstance(right, Exception):
            if not any(word in text for word in WHOLE):
                wrong.append(f"{text}: {found} where NumPy has {right!r:.60}")
            continue
        if type(found) is bool and (" == " in text or " != " in text) and np.ndim(right):
            # of another shape or kind: what records and dictionaries need
            shapes = [np.shape(outcome(x, ARRAYS, 1)) for x in text.replace("!", "=").split(" == ")]
            if shapes[0] == shapes[1] or found is not (" != " in text):
                wrong.append(f"{text}: {found}")
            continue
        a, b = numbers(found), numbers(right)
        if not b.size or text in ("np.power(w, T)", "w ** T"):  # no rows; Python's powers of negative numbers
            continue
        texts = "U" in a.dtype.kind + b.dtype.kind
        if a.shape != b.shape or not (a == b if texts else np.allclose(a, b, rtol=1e-12, atol=1e-12, equal_nan=True)):
            wrong.append(f"{text}: {found} instead of {right}")
    assert several > 800
    assert not wrong, "\n".join(wrong)
