"""Masses on rods, in positions and as bodies that touch their neighbours only: the same steps, at different cost."""

from __future__ import annotations

from typing import Any

import numpy as np

import liemech as lm


def as_bodies(chain: Any) -> Any:
    """The masses as bodies whose rods end in their centres: nothing turns them."""
    links = [lm.joints.Link(m, [1.0, 1.0, 1.0]) for m in chain.masses]
    points = [0.0, 0.0, 0.0]
    rods = [lm.joints.RigidRod(k, k - 1 if k else None, points, points, l) for k, l in enumerate(chain.lengths)]
    return lm.joints.Linkage(links, rods, gravity=chain.gravity)


def test_a_chain_of_masses_steps_as_a_linkage_of_rods() -> None:
    """LieRATTLE is RATTLE where nothing turns."""
    chain: Any = lm.models.ChainPendulum([1.0, 0.5], [1.0, 0.8])
    angles = np.array([0.5, 1.1])
    along = np.stack([np.sin(angles), 0.0 * angles, -np.cos(angles)], axis=1)
    start = chain.consistent(chain.hanging(along.ravel().tolist()), np.random.default_rng(0).normal(size=6))
    bodies = as_bodies(chain)
    poses, velocities = np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 6))
    poses[:, :3, 3] = np.reshape(np.array(start.q), (2, 3))
    velocities[:, 3:] = np.reshape(np.array(start.p), (2, 3)) / np.array(chain.masses)[:, None]
    options: Any = {"h": 0.02, "steps": 5, "compiled": False, "compensated": False, "progress": False}
    one = lm.integrate(chain, lm.RATTLE(), start, **options)
    other = lm.integrate(bodies, lm.LieRATTLE(), bodies.assembled(poses, velocities), **options)
    assert np.abs(bodies.poses(other.g)[..., :3, 3].reshape(-1, 6) - one.q).max() < 4e-15
    tensions = np.asarray(bodies.multipliers(other.mu[-1], other.g[-1]))
    assert np.allclose(tensions, np.asarray(chain.multipliers(one.q[-1], one.p[-1])), rtol=1e-12)


def test_only_neighbours_meet_in_its_elimination() -> None:
    """Rod k has a mass in common with rods k - 1 and k + 1: 3 N - 2 entries, where the chain in positions has N^2."""
    for count in (4, 9):
        bodies = as_bodies(lm.models.ChainPendulum([1.0] * count, [1.0] * count))
        assert sum(len(row) for row in bodies.shared) == 3 * count - 2
