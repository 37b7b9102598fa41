"""Refusals in the name of what was called, where another function found the fault."""

from __future__ import annotations

import pytest

import liemech as lm


@lm.record
class Circling(lm.HomogeneousEquation):
    """A point on a sphere."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(x[1], x[2], 1.0)


def test_points_too_far_off_for_a_float_are_refused_by_the_state() -> None:
    with pytest.raises(
        lm.errors.InvalidInput, match=r"Circling\.state: x is no point of SphereAction"
    ):
        Circling(lm.SphereAction(lm.SO3())).state(x=[1e308] * 3)


@pytest.mark.parametrize(
    "mu", [[[1.0, 2.0], [1.0]], [1.0, 2.0], [float("nan")] * 4, "abc"], ids=str
)
def test_groups_without_further_invariants_refuse_what_is_no_momentum(mu: object) -> None:
    assert lm.GL(2).further_invariants([1.0, 2.0, 3.0, 4.0]) is None
    with pytest.raises(
        (lm.errors.InvalidInput, lm.errors.InvalidType), match=r"GL.*further_invariants: mu"
    ):
        lm.GL(2).further_invariants(mu)


def test_momenta_that_leave_the_range_of_floats_are_refused_in_the_name_of_what_was_called() -> (
    None
):
    with pytest.raises(
        lm.errors.InvalidInput, match=r"random_on_orbit: SE3\.K has no finite value"
    ):
        lm.coadjoint(lm.SE3()).random_on_orbit([1e308] * 6, rng=5)
