"""What is written for arrays, of vectors, of matrices and of arrays of run-time numbers: NumPy's
values, one form in all worlds, and the right derivative.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiler import worlds

from liemech.errors import NotCompilable

VECTORS = """
u + 1.0; 1.0 - u; A**2; 2.0**A; A + 2.0; 2.0 - A; 1.0 / A; u[::-1] * 2.0
u.max() + u.min() + u.mean() + u.prod() + u.sum(); A.max() + A.min() + A.mean() + A.prod() + A.sum() + A.trace()
A.sum(axis=0); A.max(axis=1); u.copy(); A.flatten(); A.diagonal(); u.T
np.sum(A); np.sum(A, axis=0); np.sum(A, 1); np.trace(A); np.max(u); np.min(A); np.mean(A, axis=1); np.prod(u)
np.linalg.norm(A); np.linalg.norm(u); np.clip(u, 0.0, 0.6); np.minimum(u, 0.5); np.diag(u); np.diag(A); np.ravel(A)
np.roll(u, 1); np.roll(u, -2); np.diff(u); np.concatenate([u, u[:2]]); np.concatenate((A, A), axis=1)
np.hstack([u, u]); np.vstack([u, u]); np.stack([u, 2.0 * u]); np.stack([u, u], axis=1); np.zeros_like(u) + u
np.einsum("ij,j->i", A, u); np.einsum("i,i->", u, u); np.einsum("ij,jk->ik", A, A); np.einsum("ij,ij", A, A)
np.einsum("ii", A); np.einsum("i,j", u, u); np.tensordot(A, A); np.tensordot(A, u, axes=1); np.kron(u, u); np.kron(A, A)
np.where(x > 0.5, x, y); np.where(x > y, 1.0, -1.0) * x; np.clip(x, 0.0, 0.6); np.clip(y, -0.5, 0.5) + np.clip(x, None, 0.3)
np.where(u > 0.5, u, 0.0); np.where(u > 0.5, 1.0, 2.0) * x; x * np.all(u < 2.0) + y * np.any(u > 0.6)
np.interp(x, NODES, VALUES); np.interp(y, NODES, VALUES) * x; np.searchsorted(NODES, x)
"""
ARRAYS = """
np.array([x, 1.0, 2 * z]) * 2.0; np.array([x, y, z]) - [1.0, 2.0, 3.0]; 1.0 / np.array([x, y])
-np.array([x, y]); np.array([x, y])**2; np.array([[x, y], [z, 1.0]]) * 2.0
np.array([[x, y], [z, 1.0]]).T; np.array([[x, y], [z, 1.0]])[:, 1]; np.array([x, y, z])[::-1] * x
np.array([[x, y], [z, 1.0]]) * np.array([x, 2.0]); NODES * x; x - NODES; NODES / y; NODES * x + VALUES * y; M * x + M * y
u + np.array([x, y, z]); A @ np.array([x, y, z]); np.array([x, y, z]) @ u; M @ u; np.cross(np.array([x, y, z]), np.array([y, z, x]))
max(np.array([x, y, z])); np.array(u) * 2.0; np.array([u, u]); np.array([a * a for a in u]); (np.eye(3) * x) @ u
len(np.array([x, y])) * x; x if isinstance(np.array([x, y]), np.ndarray) else y; np.zeros(3) + x
"""
REFUSED = """
np.array([x, y])**3; M @ np.array([x, y, z])
np.sum(np.array([x, y, z])); np.array([x, y, z]).sum(); np.linalg.norm(np.array([x, y, z]))
np.array([1.0, 2.0]) * x > y; np.array([x > 0.0, y > 0.0]); np.clip(n, 0, 1) * x; np.interp(x, np.arange(100.0), np.arange(100.0))
"""
ROWS = [[0.7, -0.3, 0.55], [0.2, 0.9, -0.4], [-0.6, 0.35, 0.8], [1.25, -1.1, 1.9]]

MODULE = """
import numpy as np
from liemech.formulas import Mat, Vec, derivative, mat, vec

NODES, VALUES = np.array([-1.0, -0.25, 0.0, 0.5, 1.5]), np.array([1.0, -2.0, 0.5, 0.25, 3.0])
M = np.array([[1.0, 0.5, -0.25], [0.75, 2.0, 1.5], [0.1, 0.2, 0.3]])


def numbers(v):
    if isinstance(v, Mat) or (isinstance(v, np.ndarray) and len(v.shape) == 2):
        return [a for row in v for a in row]
    if isinstance(v, np.ndarray) and len(v.shape) == 0:  # of np.where
        return [float(v)]
    return [*v] if isinstance(v, (Vec, np.ndarray)) else [v]


"""


def _cases(text: str) -> list[str]:
    return [case.strip() for line in text.strip().splitlines() for case in line.split(";")]


def _module(cases: list[str], folder: Path, name: str) -> Any:
    """`formula(x, y, z, n)` gives all the numbers of these, `slope` how they change along (1, -1/2, z)."""
    lines = "".join(f"    found += numbers({case})\n" for case in cases)
    text = (
        f"{MODULE}def every(x, y, z, n):\n    u, A = vec(x, y, z), mat((x, y, 1.5), (z, 2.0, x * y), (0.25, z, 1.0))\n"
        f"    found = []\n{lines}    return vec(*found)\n\n\n"
        "def formula(x, y, z, n):\n    return every(x, y, z, n)\n\n\n"
        "def slope(x, y, z, n):\n"
        "    return derivative(lambda s: every(x + s, y - 0.5 * s, z * (1.0 + s), n), 0.0)\n"
    )
    return worlds.module_from(text, folder, name)


def _in_numpy(case: str, row: list[float], module: Any) -> np.ndarray:
    x, y, z = row
    names = {"np": np, "max": max, "len": len, "isinstance": isinstance, "x": x, "y": y, "z": z, "u": np.array(row),
             "A": np.array([[x, y, 1.5], [z, 2.0, x * y], [0.25, z, 1.0]])}  # fmt: skip
    return np.ravel(np.asarray(eval(case, {**vars(module), **names}), dtype=float))


EVERY = _cases(VECTORS), _cases(ARRAYS)


@pytest.mark.parametrize("cases", EVERY, ids=("vectors", "arrays"))
def test_values_of_numpy_in_plain_python(cases: list[str], tmp_path: Path) -> None:
    module = _module(cases, tmp_path, "plain_for_arrays")
    for row in ROWS:
        wanted = np.concatenate([_in_numpy(case, row, module) for case in cases])
        assert np.allclose(np.array(module.formula(*row, 2)), wanted, rtol=1e-14, atol=1e-15)


@pytest.mark.compiled
@pytest.mark.parametrize(
    "cases",
    (
        *(pytest.param(cases, marks=pytest.mark.slow) for cases in EVERY),
        *(cases[k::6] for k, cases in zip((1, 3), EVERY, strict=True)),
    ),
    ids=("vectors", "arrays", "some of vectors", "some of arrays"),
)
def test_values_of_numpy_in_all_worlds_and_their_slopes(cases: list[str], tmp_path: Path) -> None:
    module = _module(cases, tmp_path, "written_for_arrays")
    for row in ROWS:
        found = np.array(module.formula(*row, 2))
        wanted = np.concatenate([_in_numpy(case, row, module) for case in cases])
        assert np.allclose(found, wanted, rtol=1e-14, atol=1e-15)

        def along(s: float, row: list[float] = row) -> np.ndarray:
            x, y, z = row
            return np.array(module.formula(x + s, y - 0.5 * s, z * (1.0 + s), 2))

        h = 1e-4
        fourth = (8.0 * (along(h) - along(-h)) - (along(2 * h) - along(-2 * h))) / (12.0 * h)
        assert np.allclose(module.slope(*row, 2), fourth, rtol=1e-8, atol=1e-8)
    worlds.same_in_all_worlds(module.formula, ROWS)
    worlds.same_in_all_worlds(module.slope, ROWS)


@pytest.mark.compiled
@pytest.mark.parametrize("case", _cases(REFUSED))
def test_what_numpy_rounds_in_its_own_way_is_refused_by_name(case: str, tmp_path: Path) -> None:
    module = _module([case], tmp_path, "refused_for_arrays")
    with pytest.raises(NotCompilable, match=r"write (liemech\.vec|float\(x\))|PiecewisePolynomial"):
        worlds.same_in_all_worlds(module.formula, ROWS)


def test_places_of_special_numbers_are_those_of_numpy() -> None:
    from liemech.formulas.reductions import interpolated, place

    nodes, values = [-1.0, 0.0, 0.5, 2.0], [1.0, -2.0, 0.25, 3.0]
    for x in (math.nan, math.inf, -math.inf, 0.0, -0.0, *nodes, -0.7, 0.3, 3.0):
        for side in ("left", "right"):
            assert place(nodes, x, side) == np.searchsorted(nodes, x, side=side)
        assert worlds.bits(interpolated(x, nodes, values)) == worlds.bits(np.interp(x, nodes, values))


def test_bounds_and_ties_of_clip_are_those_of_numpy() -> None:
    """All but the sign of a zero that a tie gives: NumPy 2.0 and 2.2 have different ones."""
    from liemech.formulas.of_numpy import clip

    special = (0.0, -0.0, 1.0, -1.0, math.nan, math.inf)
    for x, least, most in itertools.product(special, repeat=3):
        ours, numpys = clip(x, least, most), float(np.clip(x, least, most))
        assert ours == numpys == 0.0 or worlds.bits(ours) == worlds.bits(numpys)
