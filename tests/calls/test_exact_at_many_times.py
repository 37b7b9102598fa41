"""The exact motion of a body at many times: NumPy and native code give the same bits, and a call
knows what it knew before.
"""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import batch, kernel
from liemech.models import exact_rigid_body as exact
from liemech.models import polhode

BODIES = {
    "plain": ([1.0, 1.5, 2.0], [0.5, 0.0, 0.75**0.5]),
    "unsorted": ([3.0, 1.0, 2.0], [0.3, 1.5, -0.4]),
    "oblate": ([1.0, 1.0, 1.5], [0.5, 0.3, 0.9]),
    "near the separatrix": ([2.0, 3.0, 4.0], [1.0, -0.5, 0.8660254037844386]),
    "turned": ([[2.0, 0.1, 0.3], [0.1, 2.5, -0.2], [0.3, -0.2, 1.5]], [0.2, -0.7, 0.4]),
    "molecule": ([1e-46, 1.5e-46, 2e-46], [1e-34, 2e-34, 3e-34]),
}


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> batch.Driver:
    driver = batch.Driver(polhode.moved)
    monkeypatch.setattr(exact, "_MOVED", driver)
    return driver


@pytest.mark.sample(1)
@pytest.mark.compiled
@pytest.mark.parametrize("attitude", [True, False])
def test_native_code_gives_the_bits_of_numpy(
    attitude: bool, fresh: batch.Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    t = np.concatenate([np.linspace(-7.0, 30.0, 91), [0.0, 1e5, -1e9, 1e17, 1e290]])
    for J, mu in BODIES.values():
        body = lm.RigidBody(J)
        start = body.state(mu=mu, g=lm.SO3().random(3) if attitude else None)
        fresh.next = np.inf
        plain = body.exact(start, t)
        fresh.next, fresh.spent = -1.0, 1e9
        native = body.exact(start, t)
        assert fresh.kernels, "no native code was made"
        for name, values in plain.arrays.items():
            assert np.array_equal(values, native.arrays[name])
        monkeypatch.setattr(exact, "_along", lambda *_: pytest.fail("native code is there"))
        assert np.array_equal(body.exact(start, t).mu, plain.mu)
        monkeypatch.undo()
        monkeypatch.setattr(exact, "_MOVED", fresh)


@pytest.mark.compiled
def test_native_code_is_made_when_it_pays(
    fresh: batch.Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[object] = []
    monkeypatch.setattr(kernel, "stored", lambda *_, **__: None)
    monkeypatch.setattr(kernel, "kernel", lambda *args, **__: made.append(args))
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.2, 0.3])
    body.exact(start, np.linspace(0.0, 1.0, 50))
    assert not made and 0.0 < fresh.spent < batch.DISK
    fresh.spent = 2.0 * batch.WORTH
    body.exact(start, np.linspace(0.0, 1.0, 50))
    assert len(made) == 1


def test_few_times_and_none() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.2, 0.3], g=np.eye(3))
    many = body.exact(start, np.linspace(0.0, 3.0, 7))
    for n in (0, 1, 7):
        some = body.exact(start, np.linspace(0.0, 3.0, 7)[:n])
        assert np.array_equal(some.mu, many.mu[:n]) and np.array_equal(some.g, many.g[:n])
        assert some.g.shape == (n, 3, 3)


def test_results_belong_to_the_caller() -> None:
    """Nobody can write to them, and the next call does not either."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start, t = body.state(mu=[0.5, 0.2, 0.3], g=np.eye(3)), np.linspace(0.0, 3.0, 50)
    first = body.exact(start, t)
    kept = first.g.copy()
    body.exact(body.state(mu=[0.1, -0.2, 0.3], g=np.eye(3)), t)
    assert np.array_equal(first.g, kept)
    with pytest.raises(ValueError, match="read-only"):
        first.g[0, 0, 0] = 7.0
