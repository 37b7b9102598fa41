"""Records, small vectors and matrices as Python objects, and the arguments of their methods, where nonsense is refused."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

from liemech.compiler import batch
from liemech.errors import InvalidInput, InvalidType
from liemech.formulas import Mat, Record, Vec, broadcasting, dot, mat, outer, record, sin, vec


@record
class Spring(Record):
    """A record of everything a record may hold."""

    stiffness: float
    rest: Vec = Vec(0.0, 0.0, 0.0)
    shear: Mat | None = None
    order: int = 2
    label: str = "spring"

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (3,) if kind == "Vec" else (3, 3)

    def energy(self, x: Vec) -> float:
        y = x - self.rest
        return 0.5 * self.stiffness * dot(y, y)

    def force(self, x: Vec, factor: float = 1.0) -> Vec:
        return (-factor * self.stiffness) * (x - self.rest)

    def pressed(self, g: Mat, x: Vec) -> Vec:
        return g @ x

    def hessian(self, x: Vec) -> Mat:
        return outer(x, x)

    def both(self, x: Vec) -> tuple[float, Vec, Mat]:
        return self.energy(x), self.force(x), self.hessian(x)

    def wave(self, x: Vec) -> float:
        if x[0] > 0.0:
            return sin(x[0])
        return 0


@record
class Stiff(Spring):
    def force(self, x, factor=2.0):
        """Overridden without annotations: what the arguments are is inherited."""
        return factor * super().force(x)


S = Spring(2.0, rest=[1.0, 0.0, 0.0])
X = np.array([2.0, 1.0, -1.0])


# --- arguments of methods --------------------------------------------------------------------------------------------


def test_one_element() -> None:
    assert S.energy(X) == 3.0 and isinstance(S.energy(X), float)
    assert np.array_equal(S.force(X), [-2.0, -2.0, 2.0])
    assert S.hessian(X).shape == (3, 3)
    energy, force, hessian = S.both(X)
    assert (energy, force.shape, hessian.shape) == (3.0, (3,), (3, 3))


def test_small_vectors_stay_small_vectors() -> None:
    assert isinstance(S.force(Vec(*X)), Vec) and isinstance(S.hessian(Vec(*X)), Mat)


@pytest.mark.parametrize("lead", [(4,), (2, 3), (1,), (2, 1, 3)])
def test_leading_axes(lead: tuple[int, ...], rng: np.random.Generator) -> None:
    x = rng.normal(size=(*lead, 3))
    energy, force, hessian = S.both(x)
    assert (energy.shape, force.shape, hessian.shape) == (lead, (*lead, 3), (*lead, 3, 3))
    for i in np.ndindex(*lead):
        one = S.both(x[i])
        assert energy[i] == one[0] and np.array_equal(force[i], one[1]) and np.array_equal(hessian[i], one[2])


def test_leading_axes_broadcast(rng: np.random.Generator) -> None:
    g, x = rng.normal(size=(4, 1, 3, 3)), rng.normal(size=(5, 3))
    result = S.pressed(g, x)
    assert result.shape == (4, 5, 3)
    assert np.array_equal(result[2, 3], S.pressed(g[2, 0], x[3]))
    assert np.array_equal(S.force(x, np.arange(5.0))[3], S.force(x[3], 3.0))


@pytest.mark.parametrize("lead", [(0,), (2, 0), (0, 3)])
def test_no_elements_give_no_results_of_the_right_shape(lead: tuple[int, ...]) -> None:
    x = np.empty((*lead, 3))
    energy, force, hessian = S.both(x)
    assert (energy.shape, force.shape, hessian.shape) == (lead, (*lead, 3), (*lead, 3, 3))
    assert S.pressed(np.empty((*lead, 3, 3)), x).shape == (*lead, 3)


@pytest.mark.parametrize(
    "x",
    [
        X.astype(np.float32),
        X.astype(int),
        X.tolist(),
        tuple(X.tolist()),
        np.array([X, X])[:, ::-1][0, ::-1],
        np.asfortranarray(np.array([X, X]))[1],
        np.ma.masked_array(X, mask=False),
        np.longdouble(X),
    ],
    ids=["float32", "integers", "list", "tuple", "backwards", "strided", "unmasked", "long double"],
)
def test_any_array_of_real_numbers(x: Any) -> None:
    assert np.array_equal(S.force(x), S.force(X))


def test_input_is_neither_changed_nor_kept() -> None:
    x = X.copy()
    x.flags.writeable = False
    force = S.force(x)
    assert force.flags.writeable and not np.shares_memory(force, x)


BAD = {
    "too short": (np.zeros(2), InvalidInput, r"Spring\.force: x has shape \(2,\)"),
    "no axis": (np.float64(1.0), InvalidInput, r"Spring\.force: x has shape \(\); .* \(3,\); got np\.float64\(1\.0\)"),
    "columns": (np.zeros((3, 1)), InvalidInput, r"Spring\.force: x has shape \(3, 1\); its last axes must be \(3,\)"),
    "nan": (np.array([0.0, np.nan, 0.0]), InvalidInput, r"Spring\.force: x\[1\] is nan"),
    "inf": (np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.inf]]), InvalidInput, r"Spring\.force: x\[1, 2\] is inf"),
    "complex": (np.zeros(3, complex), InvalidType, r"Spring\.force: x must be real numbers; got dtype complex128"),
    "objects": (np.array([0.0, None, 1.0], object), InvalidType, "got dtype object"),
    "strings": (["a", "b", "c"], InvalidType, "got dtype"),
    "truth values": (np.array([True, False, True]), InvalidType, "got dtype bool"),
    "ragged": ([[1.0, 2.0, 3.0], [1.0]], InvalidInput, "ragged"),
    "masked": (np.ma.masked_array(X, mask=[0, 1, 0]), InvalidInput, "masked entries"),
}


@pytest.mark.parametrize("what", BAD)
def test_refused(what: str) -> None:
    x, error, message = BAD[what]
    with pytest.raises(error, match=message):
        S.force(x)


def test_leading_axes_that_do_not_fit() -> None:
    with pytest.raises(InvalidInput, match=r"Spring\.pressed: .*\(4,\).*\(5,\).* do not broadcast"):
        S.pressed(np.zeros((4, 3, 3)), np.zeros((5, 3)))


def test_an_overriding_method_inherits_what_its_arguments_are() -> None:
    stiff = Stiff(2.0)
    assert np.array_equal(stiff.force(np.array([X, X]))[1], 2.0 * Spring(2.0).force(X))
    with pytest.raises(InvalidInput, match=r"Stiff\.force: x has shape \(2,\)"):
        stiff.force(np.zeros(2))


@pytest.mark.compiled
def test_many_elements_run_in_native_code_with_the_same_bits(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "WORTH", 0.0)
    monkeypatch.setattr(batch, "ROWS", 0)
    monkeypatch.setattr(batch, "NOISE", 0.0)
    x = rng.normal(size=(1005, 3))
    many = [S.energy(x), S.force(x, 3.0), *S.both(x), S.wave(x)]
    monkeypatch.setattr(broadcasting, "evaluate_rows", broadcasting.in_python)
    assert all(np.array_equal(a, b) for a, b in zip(many, [S.energy(x), S.force(x, 3.0), *S.both(x), S.wave(x)]))


@pytest.mark.compiled
def test_a_formula_that_gives_integers_too(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "WORTH", 0.0)
    monkeypatch.setattr(batch, "ROWS", 0)
    monkeypatch.setattr(batch, "NOISE", 0.0)
    x = -np.abs(rng.normal(size=(1000, 3)))
    x[7] *= -1.0
    wave = S.wave(x)
    assert wave[7] == np.sin(x[7, 0]) and not np.delete(wave, 7).any()


# --- fields ----------------------------------------------------------------------------------------------------------


def test_fields_become_floats_and_small_vectors() -> None:
    s = Spring(np.float32(2), np.array([1, 2, 3]), [[1, 2], [3, 4]])
    assert (type(s.stiffness), type(s.rest), type(s.shear)) == (float, Vec, Mat)
    assert all(type(x) is float for x in (*s.rest, *s.shear[1]))
    assert Spring(2).rest == Vec(0.0, 0.0, 0.0) and Spring(2).shear is None


@pytest.mark.parametrize("bad", ["2", None, True, 1j, [1.0], np.zeros(2), object()], ids=lambda x: type(x).__name__)
def test_a_number_must_be_a_number(bad: Any) -> None:
    with pytest.raises(InvalidType, match=r"Spring\.stiffness is a number"):
        Spring(bad)


def test_a_vector_must_be_a_vector() -> None:
    with pytest.raises(InvalidInput, match=r"Spring\.rest is a vector; got an array of shape \(3, 3\)"):
        Spring(1.0, np.eye(3))
    with pytest.raises(InvalidInput, match=r"Spring\.shear is a matrix; got an array of shape \(3,\)"):
        Spring(1.0, shear=X)
    with pytest.raises(InvalidType, match=r"Spring\.rest must be real numbers"):
        Spring(1.0, ["a", "b"])


def test_records_are_frozen_compare_and_say_what_they_are() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        S.stiffness = 3.0  # type: ignore[misc]
    same, other = Spring(2.0, rest=(1, 0, 0)), Spring(2.0)
    assert same == S and hash(same) == hash(S) and other != S and Stiff(2.0) != other
    assert {S: "a"}[same] == "a"
    assert repr(other) == "Spring(stiffness=2.0, rest=Vec(0.0, 0.0, 0.0), shear=None, order=2, label='spring')"
    assert dataclasses.replace(S, stiffness=5).stiffness == 5.0


def test_only_records_are_records() -> None:
    with pytest.raises(InvalidType, match="@record is for subclasses of Record"):

        @record
        class Other:
            pass


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_pickling(protocol: int) -> None:
    for thing in (S, Spring(1.0, shear=np.eye(2)), Vec(1.0, -0.0), Mat((1.0, 2.0), (3.0, 4.0)), Stiff(3.0)):
        again = pickle.loads(pickle.dumps(thing, protocol))
        assert again == thing and type(again) is type(thing) and hash(again) == hash(thing)


# --- small vectors and matrices --------------------------------------------------------------------------------------


def test_vectors_and_matrices_are_values() -> None:
    v, m = vec(1.0, 2.0), mat(vec(1.0, 2.0), vec(3.0, 4.0))
    with pytest.raises(TypeError):
        v[0] = 3.0  # type: ignore[index]
    with pytest.raises(AttributeError, match="immutable"):
        m.rows = ()  # type: ignore[misc]
    assert {m: 1}[Mat((1.0, 2.0), (3.0, 4.0))] == 1 and m != m.T and m != v
    assert eval(repr(m)) == m and eval(repr(v)) == v
    assert np.array_equal(np.array(m), [[1.0, 2.0], [3.0, 4.0]]) and np.asarray(v).shape == (2,)


def test_arithmetic_with_arrays_and_lists() -> None:
    v, a = vec(1.0, 2.0), np.array([3.0, 4.0])
    for result in (v + a, a + v, v + [3.0, 4.0]):
        assert isinstance(result, Vec) and result == Vec(4.0, 6.0)
    assert a - v == Vec(2.0, 2.0) and a * v == Vec(3.0, 8.0) and a / v == Vec(3.0, 2.0) and v @ a == 11.0


@pytest.mark.parametrize(
    "nonsense",
    [
        lambda v, m: v + 1.0,
        lambda v, m: v + vec(1.0, 2.0, 3.0),
        lambda v, m: v + (1.0, 2.0),
        lambda v, m: m + v,
        lambda v, m: m + 1.0,
        lambda v, m: m + mat(vec(1.0, 2.0)),
        lambda v, m: m @ vec(1.0, 2.0, 3.0),
        lambda v, m: v @ vec(1.0),
        lambda v, m: v + "ab",
    ],
)
def test_what_cannot_be_combined(nonsense) -> None:
    with pytest.raises(TypeError):
        nonsense(vec(1.0, 2.0), mat(vec(1.0, 2.0), vec(3.0, 4.0)))
