"""Many bodies: what is zero for good is neither stored nor multiplied, and the result is that of dense matrices."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InconsistentState, InvalidInput
from liemech.rooms.constraints import constrained_body
from liemech.rooms.constraints.conditions import connections, joint, led, solved_sparse, speeds

library: Any = lm


def hanging(count: int) -> tuple[Any, np.ndarray]:
    """A chain, and poses of its rods with all joints closed."""
    poses, top = np.tile(np.eye(4), (count, 1, 1)), np.zeros(3)
    for b, pose in enumerate(poses):
        pose[:3, :3] = lm.SO3().exp([0.3 * np.sin(b), 0.2, 0.1])
        pose[:3, 3] = top - 0.5 * pose[:3, 2]
        top = top - pose[:3, 2]
    return library.joints.chain(count), poses


@pytest.mark.parametrize("seed", range(4))
def test_elimination_solves_what_dense_matrices_do(seed: int) -> None:
    """Random conditions on random bodies, with fill: (C D C^T) x = r, D positive block by block."""
    rng = np.random.default_rng(seed)
    blocks, count = 7, 11
    touches = [tuple(sorted(rng.choice(blocks, size=rng.integers(1, 4), replace=False).tolist())) for _ in range(count)]
    rows = [[lm.vec(*rng.normal(size=6)) for _ in row] for row in touches]
    D = [np.diag(rng.uniform(0.5, 2.0, 6)) for _ in range(blocks)]
    system: Any = SimpleNamespace(**connections(touches, blocks), places=[(6 * b, 6 * b + 6) for b in range(blocks)])
    G = np.zeros((count, 6 * blocks))
    for a, (row, ties) in enumerate(zip(rows, touches, strict=True)):
        for part, b in zip(row, ties, strict=True):
            G[a, 6 * b : 6 * b + 6] = part
    whole: Any = sum(G[:, 6 * b : 6 * b + 6] @ D[b] @ G[:, 6 * b : 6 * b + 6].T for b in range(blocks))
    through = led(system, rows)
    pushed = [[lm.vec(*(D[b] @ np.array(row))) for row in block] for b, block in enumerate(through)]
    r = rng.normal(size=count)
    x, _ = solved_sparse(system, joint(system, through, pushed), r.tolist())
    assert np.allclose(whole @ np.array(x), r, rtol=0.0, atol=1e-9 * np.linalg.cond(whole))
    xi = rng.normal(size=6 * blocks)
    assert np.allclose(speeds(system, rows, lm.vec(*xi)), G @ xi, rtol=0.0, atol=1e-13)


def test_work_grows_as_the_number_of_bodies() -> None:
    """Entries of the matrix of multipliers, and products in its elimination: each further rod adds the same."""

    def work(count: int) -> tuple[int, int]:
        chain = library.joints.chain(count)
        products = sum(len(above) for _, _, below, _ in chain.elimination for *_, above in below)
        return sum(len(row) for row in chain.shared), products

    few, more, most = (np.array(work(n)) for n in (10, 20, 40))
    assert (most - more == 2 * (more - few)).all()
    # five conditions, three joints
    assert max(len(row) for row in library.joints.chain(12, axis=[0.0, 1.0, 0.0]).shared) == 15


def test_sparse_matrices_give_the_same_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    chain, poses = hanging(4)
    velocities = np.random.default_rng(2).normal(size=(4, 6))
    poses[:, :3, 3] += 1e-3 * velocities[:, :3]
    dense = chain.assembled(poses, velocities)
    monkeypatch.setattr(constrained_body, "DENSE", 0)
    assert chain._sparse
    found = chain.assembled(poses, velocities)
    assert np.allclose(found.g, dense.g, rtol=0.0, atol=1e-13) and np.allclose(found.mu, dense.mu, rtol=0.0, atol=1e-13)
    chain.state(found.mu, found.g)
    with pytest.raises(InconsistentState, match=r"c\(g\) must be zero; condition 3"):
        chain.state(found.mu, np.array(found.g) + np.eye(64)[16 + 3] * 1e-3)
    with pytest.raises(InconsistentState, match=r"G\(g\) J\^-1 mu must be zero"):
        chain.state(np.array(found.mu) + 0.1, found.g)


@pytest.mark.parametrize("most", [0, 10**9])
def test_conditions_that_depend_on_each_other_are_named(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    chain, poses = hanging(3)
    twice: Any = lm.joints.Linkage(chain.links, [*chain.joints, chain.joints[1]])
    monkeypatch.setattr(constrained_body, "DENSE", most)
    with pytest.raises(
        InvalidInput, match=r"the 12 conditions have rank 9 here; those of joint 1, joint 3 depend on each other"
    ):
        twice.assembled(poses)


@pytest.mark.slow
def test_a_long_chain_moves_and_holds_together() -> None:
    chain, poses = hanging(40)
    assert chain._sparse
    start = chain.assembled(poses)
    method, h = lm.LieRATTLE(), 0.002
    memory = method.step(chain, 0.0, method.start(chain, start, h), h)
    g = np.array(memory.state.g)
    assert np.abs(np.array(chain.constraint.value(memory.state.g))).max() < 1e-13  # of forty metres
    assert np.abs(g - np.array(start.g)).max() > 1e-6
    assert abs(chain.energy(memory.state.mu, memory.state.g) / chain.energy(start.mu, start.g) - 1.0) < 1e-6
