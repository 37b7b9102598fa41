"""Methods called with one array for each argument: the short way gives what the long way gives, in plain
Python and in native code, and refuses what it refuses.
"""

from __future__ import annotations

import pickle
import threading

import numpy as np
import pytest
import shipped

import liemech as lm
from liemech.errors import LiemechError
from liemech.formulas.calls import one_row
from liemech.formulas.vectors import small

GROUPS = [*(G for G in shipped.RIGID if not isinstance(G, lm.VectorSpace)), lm.SO(4), lm.SU(2)]  # which has no matrices
RNG = np.random.default_rng(5)


@pytest.fixture
def at_once(monkeypatch):
    """Native code is made at the first call."""
    pytest.importorskip("llvmlite")
    from liemech.compiler import batch

    monkeypatch.setattr(one_row, "SOON", -1.0)
    monkeypatch.setattr(batch, "DISK", -1.0)
    monkeypatch.setattr(batch, "WORTH", -1.0)


def calls(group):
    g, h = group.random(RNG, 2)
    xi, mu = RNG.normal(size=(2, group.dim))
    yield from [(group.exp, (xi,)), (group.log, (g,)), (group.compose, (g, h))]
    yield from [(group.inverse, (g,)), (group.Ad, (g, xi)), (group.Ad_star, (g, mu))]
    yield from [(group.algebra.hat, (xi,)), (group.dexp, (0.3 * xi, mu)), (group.contains, (g,))]
    yield from [(group.Ad_matrix, (g,)), (group.distance, (g, h)), (group.casimirs, (mu,))]


def long_way(method, args):
    """Of two equal rows, the first: what many rows give."""
    return method(*[np.stack([a, a]) for a in args])[0]


@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_the_bits_of_many_rows(group):
    for method, args in calls(group):
        ours, many = method(*args), long_way(method, args)
        assert np.array_equal(ours, many), method
        assert type(ours) is (np.ndarray if np.ndim(many) else type(many.item()))
        # and of what formulas hand to each other
        assert np.array_equal(ours, np.array(method(*map(small, args)))), method


@pytest.mark.slow
@pytest.mark.parametrize("group", [lm.SO3(), lm.UnitQuaternions(), lm.SE2(), lm.SU(2)], ids=repr)
def test_the_bits_in_native_code(group, at_once, monkeypatch):
    for method, args in calls(group):
        plain = method(*map(small, args))
        monkeypatch.setattr(type(group), "_single_rows_of_all", {}, raising=False)
        monkeypatch.setattr(type(group.algebra), "_single_rows_of_all", {}, raising=False)
        for owner in (group, group.algebra):
            if hasattr(owner, "_single_rows"):
                object.__delattr__(owner, "_single_rows")
        first, second = method(*args), method(*args)
        owner = method.__self__
        rows = [row for row in owner._single_rows.values() if row is not None]
        assert [row.native is not None for row in rows] == [True], method
        assert np.array_equal(first, np.array(plain)), method
        assert np.array_equal(second, np.array(plain)), method
        assert type(first) is type(second)
        # results do not share memory with each other or with the arguments
        if isinstance(second, np.ndarray):
            second[...] = 7.0
            assert np.array_equal(method(*args), np.array(plain))


BAD = [
    (lambda: lm.SO3().exp(np.array([1.0, np.nan, 0.0])), "xi"),
    (lambda: lm.SO3().exp(np.array([1.0, np.inf, 0.0])), "xi"),
    (lambda: lm.SO3().exp(np.array([1.0, 0.0])), "shape"),
    (lambda: lm.SO3().log(np.diag([1.0, 1.0, -1.0])), "reflection"),
    (lambda: lm.SO3().log(2.0 * np.eye(3)), "differs from the unit matrix"),
    (lambda: lm.SO3().Ad(np.eye(3), np.array(["a", "b", "c"])), "real numbers"),
    (lambda: lm.SO3().dexp_inv(np.array([7.0, 0.0, 0.0]), np.ones(3)), "2 pi"),
    (lambda: lm.SO3().exp(np.array([1j, 0.0, 0.0])), "real numbers"),
    (lambda: lm.SE3().exp(np.full(6, 1e308)), "xi"),
]


@pytest.mark.parametrize("native", [False, True])
@pytest.mark.parametrize("bad, said", BAD)
def test_refusals(bad, said, native, request):
    if native:
        request.getfixturevalue("at_once")
        good = lm.SO3()
        for _ in range(2):
            good.exp(np.ones(3))
            good.log(np.eye(3))
            good.dexp_inv(np.ones(3), np.ones(3))
    with pytest.raises((LiemechError, TypeError, ValueError), match=said):
        bad()


SLOPE = 2.0


@lm.record
class Bent(lm.Hamiltonian):
    stiffness: float

    def energy(self, mu):
        return self.stiffness * lm.dot(mu, mu) * SLOPE


def test_fields_and_globals_are_those_of_now(at_once, monkeypatch):
    mu = np.array([1.0, 2.0, 3.0])
    for stiffness in (1.0, 3.0):
        bent = Bent(stiffness)
        for slope in (2.0, 5.0, 2.0):
            monkeypatch.setitem(globals(), "SLOPE", slope)
            for _ in range(3):
                assert bent.energy(mu) == stiffness * 14.0 * slope
            assert all(row.native is not None for row in bent._single_rows.values())
    assert pickle.loads(pickle.dumps(bent)) == bent
    assert "_single_rows" not in vars(bent)


def test_other_owners_of_a_formula_with_native_code_have_it_at_once(at_once, monkeypatch):
    assert Bent(5.0).energy(np.ones(3)) == 30.0
    monkeypatch.setattr(one_row, "SOON", np.inf)
    other = Bent(7.0)
    assert [other.energy(np.ones(3)) for _ in range(3)] == [42.0] * 3
    assert all(row.native is not None for row in other._single_rows.values())


def test_switched_off(at_once, monkeypatch):
    monkeypatch.setenv("LIEMECH_COMPILE", "0")
    bent = Bent(4.0)
    assert bent.energy(np.ones(3)) == 24.0
    assert [row.native for row in bent._single_rows.values()] == [None]


def test_threads_do_not_share_a_result(at_once):
    group, wrong = lm.SO3(), []

    def turn(k):
        xi = np.array([0.1 * k, 0.2, 0.3])
        wanted = np.array(group.exp(small(xi)))
        wrong.extend(k for _ in range(3000) if not np.array_equal(group.exp(xi), wanted))

    threads = [threading.Thread(target=turn, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_lists_whole_numbers_and_rotations():
    from scipy.spatial.transform import Rotation

    group = lm.SO3()
    assert np.array_equal(group.exp([0, 1, 2]), group.exp(np.array([0.0, 1.0, 2.0])))
    assert np.array_equal(group.exp(np.array([0, 1, 2])), group.exp([0.0, 1.0, 2.0]))
    turned = Rotation.from_rotvec([0.1, 0.2, 0.3])
    assert np.allclose(group.log(turned), [0.1, 0.2, 0.3], rtol=1e-14)
    assert group.exp(np.zeros((0, 3))).shape == (0, 3, 3)
    assert group.exp(np.zeros((1, 3))).shape == (1, 3, 3)
