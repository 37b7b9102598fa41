"""The inertia of bodies that are joined: that of each turns and moves itself alone."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

import liemech as lm
from liemech.models.linkage import Link, _inertia
from liemech.systems.constrained_body import _separate


def test_full_and_diagonal_inertias_of_links_stand_in_blocks() -> None:
    full = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, 0.2], [0.1, 0.2, 1.0]])
    flat = np.array([0.9, 1.1, 1.2])
    links = Link(inertia=full, mass=0.7), Link(inertia=flat, mass=1.3), Link(inertia=full, mass=2.0)
    wanted = block_diag(
        full, 0.7 * np.eye(3), np.diag(flat), 1.3 * np.eye(3), full, 2.0 * np.eye(3)
    )
    assert np.array_equal(_inertia(links), wanted)
    assert np.array_equal(np.diag(_inertia(links[1:2])), wanted[6:12, 6:12])


def test_bodies_are_apart_unless_an_inertia_joins_two_of_them() -> None:
    group, inertia = (
        lm.ProductGroup(lm.SE3(), lm.SE3()),
        block_diag(np.eye(6) + 0.1, 2.0 * np.eye(6) + 0.1),
    )
    assert _separate(group, inertia) and _separate(group, np.diag(inertia))
    inertia[2, 8] = inertia[8, 2] = 0.1
    assert not _separate(group, inertia)
