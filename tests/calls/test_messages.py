"""Messages that say what is wrong and what helps."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


def short_run(system: lm.System, start: lm.State) -> lm.Trajectory:
    return lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=2, compiled=False)


def test_casimirs_of_a_top() -> None:
    top = lm.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0])
    run = short_run(top, top.state([0.1, 0.2, 0.3], np.eye(3)))
    with pytest.raises(
        lm.errors.InvalidInput,
        match=r"Trajectory\.casimirs: HeavyTop.* free bodies .*`run\.drift\(\)` names",
    ):
        run.casimirs  # noqa: B018


def test_rotations_of_every_kind() -> None:
    """Quaternions and matrices turn alike; of a top the configuration counts, and a motion of the
    plane is no rotation of space.
    """
    mu, energy = [0.1, 0.2, 0.3], lm.KineticEnergy([1.0, 2.0, 3.0])
    matrices = lm.LiePoissonSystem(lm.SO3(), energy)
    quaternions = lm.LiePoissonSystem(lm.UnitQuaternions(), energy)
    expected = short_run(matrices, matrices.state(mu, np.eye(3))).rotation.as_matrix()
    found = short_run(quaternions, quaternions.state(mu, [0.0, 0.0, 0.0, 1.0])).rotation.as_matrix()
    assert np.abs(found - expected).max() <= 1e-15
    top = lm.HeavyTop([1.0, 2.0, 3.0], 0.0, [0.0, 0.0, 1.0])
    assert (
        np.abs(short_run(top, top.state(mu, np.eye(3))).rotation.as_matrix() - expected).max()
        <= 1e-15
    )
    plane = lm.LiePoissonSystem(lm.SE2(), energy)
    with pytest.raises(
        lm.errors.InvalidInput, match=r"rotations of space, which elements of SE2\(\) are not"
    ):
        short_run(plane, plane.state(mu, lm.SE2().exp([0.1, 1.0, 2.0]))).rotation  # noqa: B018


def test_a_closed_form_in_the_wrong_class() -> None:
    """dexp depends on the algebra alone; in the class of the group no method would find it."""
    with pytest.raises(lm.errors.InvalidType, match=r"Misplaced\.dexp.*class of the algebra"):

        class Misplaced(lm.SO3):
            def dexp(self, xi: lm.Vec, eta: lm.Vec, side: str = "right") -> lm.Vec:  # type: ignore[misc]
                return eta


def test_nothing_to_compose() -> None:
    with pytest.raises(
        lm.errors.InvalidInput, match=r"ExactFreeBody\(\) is exact; there is no error"
    ):
        lm.Composition(lm.ExactFreeBody(), order=4)
