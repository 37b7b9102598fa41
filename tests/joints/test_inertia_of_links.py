"""The inertia of bodies that are joined: that of each turns and moves itself alone."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from liemech.models.linkage import Link, _inertia


def test_full_and_diagonal_inertias_of_links_stand_in_blocks() -> None:
    full = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, 0.2], [0.1, 0.2, 1.0]])
    flat = np.array([0.9, 1.1, 1.2])
    links = Link(inertia=full, mass=0.7), Link(inertia=flat, mass=1.3), Link(inertia=full, mass=2.0)
    wanted = block_diag(full, 0.7 * np.eye(3), np.diag(flat), 1.3 * np.eye(3), full, 2.0 * np.eye(3))
    assert np.array_equal(_inertia(links), wanted)
    assert np.array_equal(np.diag(_inertia(links[1:2])), wanted[6:12, 6:12])
