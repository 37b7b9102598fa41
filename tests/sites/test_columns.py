"""Columns: values of all sites by name, in plain Python and in native code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from liemech.compiler import kernel
from liemech.compiler.sites.planes import Planes, columns, each
from liemech.compiler.sites.site_calls import SiteCalls
from liemech.errors import InvalidType
from liemech.formulas import dot, mat, vec
from liemech.formulas.classes.layouts import carried_layout, matrix, vector
from liemech.formulas.sites import named

N = 13
FEWER = 2
BLOCK, ROW = matrix(3, 3), vector(3)
ENDS = carried_layout((0, 0.0))
"""Of another site, and a weight."""
SYSTEM = named(x=ROW, y=ROW, product=BLOCK)


def places(sites: Any) -> Any:
    """The columns of the sites."""
    return columns(sites, matrices=(BLOCK, BLOCK), ends=ENDS, system=SYSTEM)


def multiplied(one: Any, few: Any) -> None:
    """Of every site: x the second matrix times the y of another site, its first entries alone those of few."""
    other, weight = one.ends.load()
    A, B = one.matrices.load()
    y = one.system.fields.y.at(other)
    few.x.save(vec(*[weight * dot(row[:FEWER], y[:FEWER]) for row in B[:FEWER]]))
    few.product.save(mat(*[vec(*(A @ row)) for row in B[:FEWER]]))


def driver(sites: Any, turns: int) -> None:
    """Products by one site after the other, then one after the other of the two matrices in place."""
    one = places(sites)
    each(sites, multiplied, one, one.system.heads(FEWER))
    for k in range(turns):
        mine = one.matrices.nth(k % 2)
        mine.put(k, mine.at(k) + one.matrices.nth((k + 1) % 2).at(k))


def filled() -> Planes:
    rng, sites = np.random.default_rng(1), Planes.of_rows(2 * BLOCK.width + ENDS.width + SYSTEM.width, N)
    one = places(sites)
    for i in range(N):
        A, B = rng.normal(size=(2, 3, 3)).tolist()
        one.matrices.put(i, (mat(*[vec(*row) for row in A]), mat(*[vec(*row) for row in B])))
        one.ends.put(i, ((5 * i + 1) % N, 0.5 * i))
        one.system.fields.y.put(i, vec(*rng.normal(size=3).tolist()))
    return sites


def test_columns_are_the_numbers_of_arrays() -> None:
    sites = filled()
    before = places(sites)
    A, B = (np.array([np.array(before.matrices.nth(k).at(i)) for i in range(N)]) for k in (0, 1))
    y = np.array([np.array(before.system.fields.y.at(i)) for i in range(N)])
    driver(sites, 4)
    one = places(sites)
    for i in range(N):
        other, weight = one.ends.at(i)
        assert (other, weight) == ((5 * i + 1) % N, 0.5 * i) and type(other) is int
        x = np.array(one.system.fields.x.at(i))
        np.testing.assert_allclose(x[:FEWER], weight * B[i, :FEWER, :FEWER] @ y[other, :FEWER], rtol=1e-14)
        assert x[FEWER] == 0.0  # of few entries no others are touched
        product = np.array(one.system.fields.product.at(i))
        np.testing.assert_allclose(product[:FEWER], B[i, :FEWER] @ A[i].T, rtol=1e-13, atol=1e-15)
        assert not product[FEWER].any()
    for k in range(4):
        changed = (A, B)[k % 2][k] + (A, B)[(k + 1) % 2][k]
        assert np.array_equal(np.array(one.matrices.nth(k % 2).at(k)), changed)


@pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
def test_native_columns_have_the_bits_of_plain_ones() -> None:
    plain = filled()
    driver(plain, 6)
    for lanes in (1, 8):
        native = filled()
        SiteCalls(kernel.kernel(driver, native, 6, lanes=lanes), N)(native, 6)
        assert np.array_equal(native.array[:, :N].view(np.int64), plain.array[:, :N].view(np.int64)), lanes


def test_a_value_of_another_layout_is_refused() -> None:
    one = places(filled())
    with pytest.raises(InvalidType, match="a vector of 3 and becomes a vector of 2"):
        one.system.fields.x.put(0, vec(1.0, 2.0))
