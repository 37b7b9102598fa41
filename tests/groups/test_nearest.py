"""The element nearest to an array: an element, where it is least in difference, or refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.linalg import expm, polar

import liemech as lm

EPS = 2.0**-52
EXCHANGE = np.array([[0.0, 1.0], [1.0, 0.0]])


def from_generators(group: lm.MatrixLieGroup) -> lm.MatrixLieGroup:
    return lm.MatrixLieGroup.of(group.generators)


GROUPS = (
    lm.SO(4), lm.SU(2), lm.SU(3), lm.U(2), lm.Sp(2), lm.Sp(4), lm.Heisenberg(2),
    from_generators(lm.SO(3)), from_generators(lm.SU(3)),
    from_generators(lm.SL(2)), from_generators(lm.SL(3)), from_generators(lm.Heisenberg()), from_generators(lm.GL(2)),
    lm.MatrixLieGroup.of(lm.SE3().algebra.basis), lm.MatrixLieGroup.of([EXCHANGE]),
)  # fmt: skip


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: repr(g)[:36])
def test_an_element_of_the_kind_asked_for(group: lm.MatrixLieGroup) -> None:
    """On the group; real where the group is; and no neighbour is nearer, save for SU(n), whose projection is another."""
    rng = np.random.default_rng(8)
    for _ in range(3):
        g = group.random(rng)
        noise = 1e-3 * rng.normal(size=g.shape) * np.abs(g).max()
        h = np.asarray(group.nearest(g + noise))
        assert h.dtype == g.dtype
        assert group.defect(h) <= 1e-13
        if not isinstance(group, lm.SU):
            # orthogonal to h E_i: no direction within the group leads nearer
            residual = g + noise - h
            slopes = np.einsum("ab,iab->i", residual.conj(), h @ group.generated.generators).real
            assert np.abs(slopes).max() <= 1e-11 * np.linalg.norm(h)
        assert np.abs(np.asarray(group.nearest(g)) - g).max() <= 1e-12 * np.abs(g).max()


def test_at_half_turns_and_far_away() -> None:
    """There the logarithm has no unique value: the polar factor has."""
    group, rng = from_generators(lm.SO(3)), np.random.default_rng(3)
    for g in (np.diag([1.0, -1.0, -1.0]), lm.SO3().exp([np.pi, 0.0, 0.0]), lm.SO3().exp([0.0, 3.1, 0.7])):
        a = g + 1e-3 * rng.normal(size=(3, 3))
        assert np.asarray(group.nearest(a)) == pytest.approx(polar(a)[0], abs=8 * EPS)
    far = np.diag([1.0, 2.0, 3.0]) + 0.5 * rng.normal(size=(3, 3))
    assert np.asarray(group.nearest(far)) == pytest.approx(polar(far)[0], abs=8 * EPS)
    minus = from_generators(lm.SL(2)).nearest(-np.eye(2) * 1.01)
    assert np.asarray(minus) == pytest.approx(-np.eye(2), abs=8 * EPS)
    assert np.asarray(from_generators(lm.SU(2)).nearest(-1.01 * np.eye(2))) == pytest.approx(-np.eye(2), abs=8 * EPS)


def test_heisenberg_takes_the_entries_that_are_free() -> None:
    a = np.arange(9.0).reshape(3, 3) - 4.0
    assert np.array_equal(lm.Heisenberg().nearest(a), [[1, a[0, 1], a[0, 2]], [0, 1, a[1, 2]], [0, 0, 1]])


def test_size_does_not_matter_for_rotations() -> None:
    rng = np.random.default_rng(4)
    q, R = rng.normal(size=4), lm.SO3().random(rng)
    turn = lm.SE2().exp([0.7, 0.0, 0.0])
    for size in (1e-300, 1.0, 1e300):
        assert np.asarray(lm.UnitQuaternions().nearest(size * q)) == pytest.approx(q / np.linalg.norm(q), abs=2 * EPS)
        assert np.asarray(lm.SO3().nearest(size * R)) == pytest.approx(R, abs=8 * EPS)
        assert np.asarray(lm.SO(3).nearest(size * R)) == pytest.approx(R, abs=8 * EPS)
        assert np.asarray(from_generators(lm.SO(3)).nearest(size * R)) == pytest.approx(R, abs=8 * EPS)
        moved = np.array(turn)
        moved[:2, :2] *= size
        assert np.asarray(lm.SE2().nearest(moved)) == pytest.approx(turn, abs=2 * EPS)


@pytest.mark.parametrize(
    "group", [lm.Sp(2), lm.Sp(4), from_generators(lm.SL(2)), from_generators(lm.GL(2))], ids=range(4)
)
def test_too_far_is_refused(group: lm.MatrixLieGroup) -> None:
    """Singular, without an element near, or so large that squares overflow: at once, and by name."""
    n = group.generated.n
    for a in (np.zeros((n, n)), np.ones((n, n)), 1e200 * np.ones((n, n)), np.diag([0.0] * (n - 1) + [1.0])):
        with pytest.raises(lm.errors.InvalidInput, match="nearest: the array is too far from the group"):
            group.nearest(a)


def test_no_nearest_among_several() -> None:
    for group, a in (
        (lm.SO3(), np.zeros((3, 3))),
        (lm.SO3(), -np.eye(3)),  # every half turn is as near
        (lm.SO(3), np.ones((3, 3))),
        (lm.SE2(), np.diag([1.0, -1.0, 1.0])),
        (lm.U(2), np.ones((2, 2))),
        (lm.SU(3), np.zeros((3, 3))),
    ):
        with pytest.raises(lm.errors.InvalidInput, match="nearest: the array is"):
            group.nearest(a)
    with pytest.raises(lm.errors.InvalidInput, match="singular"):
        lm.GL(2).nearest(np.ones((2, 2)))


def test_boosts_from_the_polar_factor_of_their_form() -> None:
    """SO(1, 1), far from the unit matrix."""
    group, g = lm.MatrixLieGroup.of([EXCHANGE]), expm(5.0 * EXCHANGE)
    noise = 1e-4 * np.array([[1.0, -2.0], [0.5, 3.0]])
    found = np.asarray(group.nearest(g + noise))
    assert group.defect(found) <= 1e-15
    assert np.linalg.norm(found - g - noise) <= np.linalg.norm(noise)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_a_reflection_is_turned_along_its_shortest_direction(n: int, rng: np.random.Generator) -> None:
    """The stationary points of |h - g| on SO(n) are u s v, s = diag(+-1, ...), g = u d v: none of them is nearer."""
    for _ in range(10):
        g = rng.normal(size=(n, n))
        g[0] *= -np.sign(np.linalg.det(g))
        u, _, v = np.linalg.svd(g)
        signs = (np.array(s) for s in itertools.product((1.0, -1.0), repeat=n))
        turned = [(u * s) @ v for s in signs]
        least = min(np.linalg.norm(h - g) for h in turned if np.linalg.det(h) > 0.0)
        for group in [lm.SO(n), *([lm.SO3()] if n == 3 else [])]:
            h = np.asarray(group.nearest(g))
            assert np.linalg.det(h) > 0.0
            assert np.linalg.norm(h - g) == pytest.approx(least, rel=1e-12)


def spin(j: float) -> np.ndarray:
    """-i J_k of the representation of SU(2) of dimension 2 j + 1."""
    m = np.arange(j, -j - 1.0, -1.0)
    up = np.diag(np.sqrt(j * (j + 1.0) - m[1:] * (m[1:] + 1.0)), 1)
    return -1j * np.array([0.5 * (up + up.T), -0.5j * (up - up.T), np.diag(m)])


def five() -> np.ndarray:
    """Rotations of symmetric matrices without trace."""
    e = np.eye(3)
    pairs = [np.outer(e[i], e[j]) + np.outer(e[j], e[i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    basis = [*pairs, np.diag([1.0, -1.0, 0.0]), np.diag([1.0, 1.0, -2.0])]
    unit = [b / np.linalg.norm(b) for b in basis]
    turns = lm.SO3().algebra.basis
    return np.array([[[np.trace(a @ (L @ b - b @ L)) for b in unit] for a in unit] for L in turns])


def quaternionic() -> np.ndarray:
    """Sp(2): antihermitian 2 x 2 matrices of quaternions."""
    i, j, k = (1j * np.array(s) for s in ([[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]))
    corners = [np.kron(np.diag(d), q) for d in ((1, 0), (0, 1)) for q in (i, j, k)]
    across = [np.kron(EXCHANGE, q) for q in (i, j, k)]
    return np.array([*corners, *across, np.kron([[0, 1], [-1, 0]], np.eye(2))])


TWICE = np.array([np.kron(np.diag([1.0, 0.0]), [[0, -1], [1, 0]]) * 1.0])
PROPER = {
    "spin 1": spin(1.0),
    "spin 3/2": spin(1.5),
    "spin 2": spin(2.0),
    "SO(3) on R^5": five(),
    "Sp(2)": quaternionic(),
    "two turns at 1 and 3": TWICE + 3.0 * np.kron(np.diag([0.0, 1.0]), [[0, -1], [1, 0]]),
}


def exponentials(generators: np.ndarray, h: np.ndarray) -> list[np.ndarray]:
    """All elements that turn the algebra as h does: for three generators of rotations, the
    exponentials of the angle found and of one full turn more.
    """
    if len(generators) == 1:
        angle = np.angle(np.linalg.eigvals(h))
        return [expm(x * generators[0]) for x in (*angle, *-angle)]
    moved = h @ generators @ np.linalg.inv(h)
    squares = np.einsum("kab,kab->k", generators.conj(), generators).real
    turned = np.einsum("iab,kab->ik", generators.conj(), moved).real / squares[:, None]
    x = np.asarray(lm.SO3().log(np.asarray(lm.SO3().nearest(turned))))
    further = x * (1.0 + 2.0 * np.pi / np.linalg.norm(x))
    return [expm(np.tensordot(y, generators, 1)) for y in (x, further)]


@pytest.mark.parametrize("name", PROPER)
def test_proper_subgroups_of_rotations(name: str) -> None:
    """An element of the group, not only a unitary matrix, and none beside it is nearer."""
    generators = PROPER[name]
    group, rng = lm.MatrixLieGroup.of(generators), np.random.default_rng(5)
    for off in (0.0, 1e-9, 1e-5, 1e-2, 0.1):
        g = np.asarray(group.exp(2.0 * rng.normal(size=group.dim)))
        noise = rng.normal(size=(2, *g.shape)) * off * np.linalg.norm(g) / g.size**0.5
        array = g + noise[0] + (0.7j * noise[1] if np.iscomplexobj(g) else 0.0)
        h = np.asarray(group.nearest(array))
        assert np.linalg.norm(h - g) <= 2.0 * np.linalg.norm(array - g) + 1e-13
        slopes = np.einsum("ab,iab->i", (array - h).conj(), h @ generators).real
        assert np.abs(slopes).max() <= 1e-11 * np.linalg.norm(h)
        if name == "Sp(2)":  # what keeps both forms
            assert group.defect(h) <= 1e-14
        else:
            assert min(np.abs(h - e).max() for e in exponentials(generators, h)) <= 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SO(3) on R^5", *sorted(set(PROPER) - {"SO(3) on R^5"})])
def test_proper_subgroups_obey_the_laws(name: str) -> None:
    assert lm.check_group(lm.MatrixLieGroup.of(PROPER[name]))
