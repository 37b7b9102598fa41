"""Powers of a group: they are what the direct product of as many factors is, with an axis of sites."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType

BASES = lm.SO3(), lm.SE3(), lm.VectorSpace(3), lm.SU(2), lm.UnitQuaternions()


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_a_power_is_the_product_of_its_copies(base: Any) -> None:
    power, product = base**3, lm.ProductGroup(base, base, base)
    rng = np.random.default_rng(1)
    g, h = product.random(rng), product.random(rng)
    xi, mu = rng.normal(size=(2, product.dim))
    assert power.dim == product.dim and power.element_shape == product.element_shape
    assert power.unit_blocks == product.unit_blocks
    for name, arguments in {
        "compose": (g, h), "inverse": (g,), "Ad": (g, xi), "K": (g, mu), "exp": (xi,),
        "log": (g,), "dexp": (xi, mu), "dexp_inv": (xi, mu), "ad_star": (xi, mu), "casimirs": (mu,),
        "compose_exp": (g, xi), "defect": (g,),
    }.items():  # fmt: skip
        assert np.array_equal(getattr(power, name)(*arguments), getattr(product, name)(*arguments)), name


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_arrays_may_have_an_axis_of_sites(base: Any) -> None:
    power = base**4
    rng = np.random.default_rng(2)
    xi = rng.normal(size=(5, 4, base.dim))
    assert np.array_equal(power.log(power.exp(0.1 * xi)).reshape(5, -1), power.log(power.exp(0.1 * xi.reshape(5, -1))))
    g, mu = base.random(rng, (5, 4)), rng.normal(size=(5, 4, base.dim))
    assert np.array_equal(power.K(g, mu), base.K(g, mu))
    assert power.compose(g, g).shape == g.shape


def test_a_large_power_costs_nothing() -> None:
    begun = time.process_time()
    group = lm.SE3() ** 10**7
    assert group.dim == 6 * 10**7 and group.element_shape == (16 * 10**7,)
    assert repr(group) == "SE3() ** 10000000" and hash(group) == hash(lm.SE3() ** 10**7)
    assert time.process_time() - begun < 1.0


def test_what_is_no_power_is_named() -> None:
    for copies in (0, -1, True):
        with pytest.raises(InvalidInput, match="sites"):
            lm.SO3() ** copies
    with pytest.raises(InvalidType, match="copies"):
        lm.SO3() ** 2.5  # type: ignore[operator]
    with pytest.raises(InvalidType, match="brackets"):
        lm.PowerGroup(lm.SO3, 3)  # type: ignore[arg-type]


@pytest.mark.slow
def test_laws_hold() -> None:
    lm.check_group(lm.SE3() ** 2)
