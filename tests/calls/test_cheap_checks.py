"""What is seen at a glance is what the long way would have said: the same values, the same refusals."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import check_finite, real_array
from liemech.formulas.arrays import at_a_glance
from liemech.systems.input_checks import element_at_a_glance

VALUES: list[Any] = [
    [1.0, 2.0, 3.0],
    (1.0, 2, 3.0),
    [1, 2, 3],
    [0.0, -0.0, 5e-324],
    np.array([1.0, 2.0, 3.0]),
    np.array([1, 2, 3]),
    np.array([1.0, 2.0, 3.0], dtype=">f8"),
    np.arange(6.0)[::2],
    np.float32([1.0, 0.1, 3.0]),
    [1.0, float("nan"), 2.0],
    [1.0, float("inf"), 2.0],
    np.array([1.0, np.nan, 2.0]),
    np.array([1e308, 1e308, 1e308]),
    [True, 2.0, 3.0],
    [True, False, True],
    [1.0, 2.0],
    [1.0, 2.0, 3.0, 4.0],
    [[1.0, 2.0, 3.0]],
    [10**400, 1.0, 2.0],
    [2**53 + 1, 1.0, 2.0],
    [10**20, 1, 2],
    [1.0, 2.0, 3j],
    [1.0, None, 3.0],
    ["1", 2.0, 3.0],
    "abc",
    None,
    7.0,
    np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]),
]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_a_glance_never_says_more_than_a_closer_look(value: Any) -> None:
    found = at_a_glance(value, (3,))
    if found is not None:
        array = real_array(value, "x")
        check_finite(array, "x")
        assert np.array(found).tobytes() == array.tobytes() and type(found) is lm.Vec


@pytest.mark.parametrize(
    "group", [lm.SO3(), lm.SE3(), lm.SE2(), lm.SU(2), lm.UnitQuaternions(), lm.VectorSpace(3)], ids=repr
)
def test_elements_at_a_glance_are_those_that_the_group_contains(group: lm.LieGroup, rng: np.random.Generator) -> None:
    g = group.random(rng)
    seen = element_at_a_glance(group, g)
    assert group.is_complex == (seen is None)
    for size in (1e-9, 2e-7, 5e-6, 1e-3, np.nan, np.inf):
        for index in np.ndindex(g.shape):
            other = g.copy()
            other[index] += size
            seen = element_at_a_glance(group, other)
            assert seen is None or (np.isfinite(other).all() and group.contains(other))


def test_a_glance_is_enough_for_what_people_write(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ordinary bodies and starts never take the long way."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    for module in ("input_checks", "lie_poisson"):
        monkeypatch.setattr(f"liemech.systems.{module}.points", lambda *_: pytest.fail("the long way"))
    monkeypatch.setattr("liemech.systems.inertia.real_array", lambda *_: pytest.fail("the long way"))
    monkeypatch.setattr("liemech.systems.kinetic_energy.real_array", lambda *_: pytest.fail("the long way"))
    start = body.state(mu=[0.5, 0, 0.75**0.5], g=np.eye(3))
    assert start == body.state(np.array([0.5, 0.0, 0.75**0.5]), g=np.eye(3))
    lm.RigidBody([1.0, 1.5, 2.0]), lm.RigidBody((1, 2, 3)), lm.RigidBody(np.array([1.0, 1.5, 2.0]))
    lm.models.KirchhoffBody([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


WRONG = ([1.0, 1.5, 0.0], [1.0, -1.5, 2.0], [1e-320, 1.0, 1.0], [1.0, float("nan"), 2.0], [1.0, 2.0, 9.0])


@pytest.mark.parametrize("moments", WRONG)
def test_refusals_and_warnings_are_the_same_for_lists_and_for_other_forms(moments: list[float]) -> None:
    def said(value: Any) -> str:
        try:
            lm.RigidBody(value)
        except (lm.errors.InvalidInput, lm.errors.InertiaWarning) as error:
            return f"{type(error).__name__}: {error}"
        return ""

    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        quick = said(moments)
        patch.setattr("liemech.systems.inertia.at_a_glance", lambda *_: None)
        assert quick and quick == said(moments)
