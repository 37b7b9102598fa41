"""Square blocks in memory: those of every site, and elimination with them, have the bits of Python in native
code of any number of lanes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from liemech.compiler import kernel
from liemech.compiler.numbers.square_blocks import block_at, lead_block, lessen_block, put_block, save_block, wide
from liemech.compiler.sites.planes import Planes, columns, each
from liemech.compiler.sites.site_calls import SiteCalls
from liemech.formulas import mat, vec
from liemech.formulas.classes.layouts import Layout, layout_of, vector

SIZES = (1, 3, 6, 9)
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


def saved(matrices: Any, blocks: Any) -> None:
    """Two blocks of a site."""
    A = matrices.load()
    save_block(blocks, 2, 1, A)
    save_block(blocks, 2, 0, A @ A)


def eliminate(planes: Planes, behind: Planes, layout: Layout, count: int) -> None:
    """B_i becomes B_i-1 B_i, and loses B_i-2 B_i then; the last block is moved to the front."""
    n = next(k for k in SIZES if k * k == layout.width)
    blocks = columns(behind, all=vector(0)).all
    each(planes, saved, columns(planes, matrices=layout).matrices, blocks)
    for i in range(2, 2 * count):
        lead_block(blocks, i, block_at(blocks, i - 1, n))
        lessen_block(blocks, i, i - 2, i, n)
    put_block(blocks, 0, block_at(blocks, 2 * count - 1, n))


@native
@pytest.mark.parametrize("n", SIZES)
def test_bits_of_blocks(n: int) -> None:
    count = 5
    layout = layout_of(mat(*[vec(*[0.0] * n)] * n))
    A = np.random.default_rng(n).uniform(-1.0, 1.0, (n, n, count)) / n

    def after(lanes: int) -> np.ndarray:
        planes = Planes.of_rows(n * n, count)
        planes.array[:, :count] = A.reshape(-1, count)
        blocks = Planes.of_rows(2 * n * wide(n), count)
        given: Any = planes, blocks, layout, count
        if lanes:
            SiteCalls(kernel.kernel(eliminate, *given, lanes=lanes), count)(*given)
        else:
            eliminate(*given)
        size = n * wide(n)
        found = blocks.array.reshape(-1)[: 2 * count * size].reshape(-1, n, wide(n))[:, :, :n]
        return found.copy()

    plain = after(0)
    B = [x for a in np.moveaxis(A, -1, 0) for x in (a @ a, a)]
    for i in range(2, 2 * count):
        led = B[i - 1] @ B[i]
        B[i] = led - B[i - 2] @ led
    B[0] = B[-1]
    assert np.allclose(plain, B, rtol=1e-12, atol=1e-12 * np.abs(B).max())
    for lanes in (1, 8, 16) if n == 3 else (8,):
        assert np.array_equal(after(lanes), plain), lanes
