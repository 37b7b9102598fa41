"""Columns: values of all sites by name, in plain Python and in native code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from liemech.compiler import kernel
from liemech.compiler.driver import accepted, attempt, itself, write
from liemech.compiler.sites.planes import Planes, columns, each
from liemech.compiler.sites.site_calls import SiteCalls
from liemech.errors import InvalidType
from liemech.formulas import dot, mat, vec
from liemech.formulas.classes.layouts import carried_layout, layout_of, matrix, vector
from liemech.formulas.columns import named

N = 13
FEWER = 2
NUMBER, BLOCK, ROW = layout_of(0.0), matrix(3, 3), vector(3)
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


def inverse(one: Any) -> None:
    """1/x of a site, which raises where x is zero."""
    one.y.save(1.0 / one.x.load())


def inverted(sites: Any, done: Any) -> None:
    """The inverse at every site, or the news that there is none."""
    if accepted(attempt(each, sites, inverse, columns(sites, x=NUMBER, y=NUMBER)), itself):
        write(done, 0, 1.0, NUMBER)


@pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
@pytest.mark.parametrize("lanes", [1, 8, 16])
@pytest.mark.parametrize("zero", [None, 0, 4, N - 1])
def test_places_behind_the_last_site_cannot_fail(lanes: int, zero: int | None) -> None:
    """Rows are padded, and what lies there is nobody's: no zero there ends a step, and one at a site does."""
    sites, done = Planes.of_rows(2, N), np.zeros(1)
    sites.array[0, :N] = 2.0
    if zero is not None:
        sites.array[0, zero] = 0.0
    arguments = sites, kernel.Shared(done)
    SiteCalls(kernel.kernel(inverted, *arguments, lanes=lanes), N, 1)(*arguments)
    assert done[0] == (zero is None)
    assert zero is not None or np.array_equal(sites.array[1, :N], np.full(N, 0.5))
