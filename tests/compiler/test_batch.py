"""Methods called with many rows run as native code, row by row what plain Python says, in whatever
form the arrays come.
"""

from __future__ import annotations

import gc
import inspect
import warnings
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import same_bits

import liemech as lm
from liemech.compiler import batch, kept
from liemech.errors import InvalidInput, NotCompiledWarning, OutsideChart
from liemech.formulas import Complex, Mat, Record, Vec, record, sqrt, vec
from liemech.formulas.calls import batches
from liemech.formulas.classes.signatures import bare
from liemech.formulas.vectors import Vec as SmallVec
from liemech.groups.rigid.so3 import SO3Algebra

pytestmark = pytest.mark.compiled

SO3 = lm.SO3()
N = 517  # no multiple of any number of lanes

CALLS: dict[str, dict[str, Any]] = {"dexp_inv_series": {"terms": 4}, "from_quaternion": {"order": "wxyz"}}
"""Arguments that are no arrays."""

METHODS = sorted(
    {
        name
        for owner in (lm.SO3, SO3Algebra)
        for name in dir(owner)
        if not name.startswith("_")
        and hasattr(getattr(owner, name), "__formula__")
        # work of NumPy, LAPACK and SciPy
        and name not in ("nearest", "rotation", "random", "objection", "scale")
    }
)


def owner_of(name: str) -> Any:
    """The group, or its algebra, where the method is."""
    return SO3 if hasattr(lm.SO3, name) else SO3.algebra


@pytest.fixture(scope="module")
def rows() -> dict[str, np.ndarray]:
    """Arguments by name: angles from 0 to 3 with many small ones, and rotations by them."""
    rng = np.random.default_rng(20_240_229)
    axis = rng.normal(size=(5, N, 3))
    xi, other, eta, mu, p = axis / np.linalg.norm(axis, axis=2, keepdims=True)
    angle = 3.0 * rng.random((N, 1)) ** 4
    angle[7] = 0.0
    g = np.array([np.array(SO3.exp(Vec.of(w))) for w in 2.9 * rng.random((N, 1)) * other])
    h = g[::-1].copy()
    q = rng.normal(size=(N, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    rate = rng.normal(size=(N, 3, 3))
    return {"xi": angle * xi, "eta": eta, "mu": mu, "p": p, "g": g, "h": h, "q": q, "rate": rate, "matrix": g - h}


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Native code is made at once."""
    monkeypatch.setattr(batch, "WORTH", 0.0)
    monkeypatch.setattr(batch, "ROWS", 0)
    monkeypatch.setattr(batch, "NOISE", 0.0)


@pytest.fixture
def no_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows evaluated in plain Python, but for the first two, are an error."""
    evaluate = batches.Batch.row

    def first(self: batches.Batch, i: int) -> Any:
        assert i < 2, "plain Python was asked"
        return evaluate(self, i)

    monkeypatch.setattr(batches.Batch, "row", first)


def arguments_of(name: str, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    parameters = inspect.signature(bare(getattr(type(owner_of(name)), name))).parameters
    return {k: rows[k] for k in parameters if k in rows}


def in_python(name: str, arrays: dict[str, np.ndarray], owner: Any = None) -> Any:
    """The formula for one row after the other, on small vectors."""
    owner = owner or owner_of(name)
    formula = bare(getattr(type(owner), name))
    count = len(next(iter(arrays.values())))
    found = [formula(owner, **batches.row_of(arrays, i), **CALLS.get(name, {})) for i in range(count)]
    if isinstance(found[0], tuple) and not isinstance(found[0], SmallVec):
        return tuple(np.array([np.array(one[k]) for one in found]) for k in range(len(found[0])))
    return np.array([np.array(one) for one in found])


def equal(a: Any, b: Any) -> bool:
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(equal, a, b))
    if a.dtype != b.dtype:
        return False
    return np.array_equal(a, b) if a.dtype == bool else same_bits(np.ascontiguousarray(a), np.ascontiguousarray(b))


def test_the_list_is_the_public_surface() -> None:
    assert {"exp", "log", "compose", "inverse", "Ad", "Ad_star", "K", "dexp", "dexp_inv", "cayley", "distance"} <= set(
        METHODS
    )
    assert len(METHODS) > 40


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", METHODS)
def test_every_method_gives_the_bits_of_plain_python(name: str, rows: dict[str, np.ndarray], no_python: None) -> None:
    arrays = arguments_of(name, rows)
    assert equal(getattr(owner_of(name), name)(**arrays, **CALLS.get(name, {})), in_python(name, arrays))


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", ["compose", "Ad_star", "exp_Ad_star", "exp_residual"])
def test_one_row_serves_all(name: str, rows: dict[str, np.ndarray], no_python: None) -> None:
    arrays = arguments_of(name, rows)
    for one in arrays:
        given = arrays | {one: arrays[one][3]}
        spread = arrays | {one: np.broadcast_to(arrays[one][3], arrays[one].shape)}
        assert equal(getattr(owner_of(name), name)(**given), in_python(name, spread))


def test_leading_axes_broadcast(rows: dict[str, np.ndarray], no_python: None) -> None:
    g, mu = rows["g"][:50], rows["mu"][:45]
    moved = SO3.Ad_star(g[:, None], mu)
    assert moved.shape == (50, 45, 3)
    assert equal(moved[13, 17], np.array(SO3.Ad_star(Mat.of(g[13]), Vec.of(mu[17]))))


def read_only(a: np.ndarray) -> np.ndarray:
    a = a.copy()
    a.flags.writeable = False
    return a


def every_other(a: np.ndarray) -> np.ndarray:
    return np.repeat(a, 2, axis=0)[::2]


def backwards(a: np.ndarray) -> np.ndarray:
    return a[::-1].copy()[::-1]


def wider(a: np.ndarray) -> np.ndarray:
    """Columns of a wider array."""
    return np.concatenate([a, a], axis=-1)[..., : a.shape[-1]]


def crooked(a: np.ndarray) -> np.ndarray:
    """At addresses that are no multiples of eight, as in packed files."""
    packed = np.zeros(len(a), dtype=np.dtype([("tag", "i1"), ("value", "f8", a.shape[1:])], align=False))
    packed["value"] = a
    return packed["value"]


FORMS = (
    read_only,
    every_other,
    backwards,
    wider,
    crooked,
    np.asfortranarray,
    lambda a: a.astype(a.dtype.newbyteorder()),
    lambda a: a.tolist(),
)


@pytest.mark.sample(5)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["exp", "log", "compose", "Ad_star"])
def test_arrays_in_any_form(form: Callable[..., Any], name: str, rows: dict[str, np.ndarray], no_python: None) -> None:
    arrays = arguments_of(name, rows)
    before = {k: a.copy() for k, a in arrays.items()}
    given = {k: form(a) for k, a in arrays.items()}
    assert equal(getattr(owner_of(name), name)(**given), getattr(SO3, name)(**arrays))
    assert all(np.array_equal(given[k], before[k]) for k in before)


def test_short_floats_and_integers(rows: dict[str, np.ndarray], no_python: None) -> None:
    short = rows["xi"].astype(np.float32)
    assert equal(SO3.exp(short), SO3.exp(short.astype(float)))
    turns = np.eye(3, dtype=int)[np.arange(N) % 3]
    assert equal(SO3.exp(turns), SO3.exp(turns.astype(float)))


def test_threads_and_where_they_meet(
    rows: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch, no_python: None
) -> None:
    monkeypatch.setattr(batch, "SHARE", 10**9)
    alone = SO3.log(rows["g"])
    monkeypatch.setattr(batch, "SHARE", 100)
    for cores in (2, 3, 7):
        monkeypatch.setattr(batch.os, "sched_getaffinity", lambda _, cores=cores: set(range(cores)), raising=False)
        assert equal(SO3.log(rows["g"]), alone)


# ------------------------------------------------------------------ bad rows

BAD = 12345


@pytest.fixture
def many(rng: np.random.Generator) -> dict[str, np.ndarray]:
    g = np.broadcast_to(np.eye(3), (3 * 2048 * 5, 3, 3)).copy()
    return {"g": g, "mu": rng.normal(size=(len(g), 3))}


@pytest.mark.sample(8)
@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (np.full((3, 3), np.nan), rf"g\[{BAD}, 0, 0\] is nan"),
        (np.diag([1.0, np.inf, 1.0]), rf"g\[{BAD}, 1, 1\] is inf"),
        (np.diag([1.0, 1.0, -1.0]), rf"g\[{BAD}\] .*reflection"),
        (2.0 * np.eye(3), rf"g\[{BAD}\] .*g\^T g"),
        (np.eye(3) + 2e-6 * np.ones((3, 3)), rf"g\[{BAD}\] .*g\^T g"),
    ],
)
@pytest.mark.parametrize("name", ["log", "Ad_star", "inverse"])
def test_a_bad_row_is_named(name: str, value: np.ndarray, reason: str, many: dict[str, np.ndarray]) -> None:
    many["g"][BAD] = value
    with pytest.raises(InvalidInput, match=reason):
        getattr(SO3, name)(**arguments_of(name, many))


@pytest.mark.parametrize("row", [0, BAD, -1])
def test_a_row_that_the_formula_refuses(row: int, many: dict[str, np.ndarray]) -> None:
    many["g"][row] = np.diag([1.0, -1.0, -1.0])
    with pytest.raises(OutsideChart, match="half a turn"):
        SO3.cayley_inv(many["g"])


def test_momenta_that_are_not_finite(many: dict[str, np.ndarray]) -> None:
    many["mu"][BAD, 2] = -np.inf
    with pytest.raises(InvalidInput, match=rf"mu\[{BAD}, 2\] is -inf"):
        SO3.Ad_star(**many)


def test_huge_rows_are_not_refused(many: dict[str, np.ndarray]) -> None:
    """Their sum overflows, they do not."""
    many["mu"][BAD] = 1.5e308, 1.5e308, 0.0
    assert equal(SO3.Ad_star(**many), many["mu"])


def test_one_bad_row_for_all(many: dict[str, np.ndarray]) -> None:
    with pytest.raises(InvalidInput, match="reflection"):
        SO3.Ad_star(-np.eye(3), many["mu"])


# ------------------------------------------------------------------ other results


@record
class Sampler(Record):
    """Formulas with results of every kind, and options between the arrays."""

    scale: float

    def phase(self, x: Vec) -> Any:
        return vec(Complex(x[0], x[1]), Complex(self.scale, x[2]))

    def mixed(self, x: Vec) -> Any:
        return vec(x[0], Complex(x[1], x[2]), 2.0)

    def square(self, m: Mat) -> Any:
        return m @ m

    def _complex(self, kind: str) -> bool:
        return kind == "Mat"

    def nested(self, x: Vec) -> Any:
        return (x[0], (x[1] > 0.0, 2.0 * x)), 1.0

    def between(self, x: Vec, sign: bool = True, y: Vec = None) -> Any:
        return x - y if sign else x + y

    def root(self, x: Vec) -> float:
        return sqrt(x[0] * x[0] + self.scale)


def test_complex_results(rng: np.random.Generator) -> None:
    x, sampler = rng.normal(size=(N, 3)), Sampler(0.5)
    assert np.array_equal(sampler.phase(x), np.stack([x[:, 0] + 1j * x[:, 1], 0.5 + 1j * x[:, 2]], axis=1))
    assert np.array_equal(
        sampler.mixed(x), np.stack([x[:, 0] + 0j, x[:, 1] + 1j * x[:, 2], np.full(N, 2.0 + 0j)], axis=1)
    )


def test_complex_arguments(rng: np.random.Generator, no_python: None) -> None:
    m = rng.normal(size=(N, 2, 2)) + 1j * rng.normal(size=(N, 2, 2))
    squares = Sampler(0.5).square(m)
    assert np.array_equal(squares, in_python("square", {"m": m}, Sampler(0.5)))
    assert np.allclose(squares, m @ m, rtol=0.0, atol=1e-13)


def test_nested_results(rng: np.random.Generator, no_python: None) -> None:
    x = rng.normal(size=(N, 3))
    (first, (positive, twice)), one = Sampler(0.5).nested(x)
    assert np.array_equal(first, x[:, 0])
    assert positive.dtype == bool
    assert np.array_equal(positive, x[:, 1] > 0.0)
    assert np.array_equal(twice, 2.0 * x)
    assert np.array_equal(one, np.ones(N))


def test_options_between_the_arrays(rng: np.random.Generator, no_python: None) -> None:
    x, y = rng.normal(size=(2, N, 3))
    assert np.array_equal(Sampler(0.5).between(x, False, y), x + y)
    assert np.array_equal(Sampler(0.5).between(y=y, x=x), x - y)


def test_numbers_come_back_as_one_axis(rng: np.random.Generator, no_python: None) -> None:
    x = rng.normal(size=(N, 3))
    assert equal(Sampler(0.5).root(x), np.array([Sampler(0.5).root(Vec.of(row)) for row in x]))


def test_without_native_code_rows_are_evaluated_in_python(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    x = rng.normal(size=(N, 3))
    native = SO3.exp(x)
    monkeypatch.setenv("LIEMECH_COMPILE", "0")
    assert equal(SO3.exp(x), native)


# ------------------------------------------------------------------ rows that native code marks


def test_marked_rows_are_evaluated_in_python_and_kept() -> None:
    """Sums overflow in a row, its numbers do not."""
    xi = np.broadcast_to([1e308, 1e308, 1.0], (600, 3)).copy()
    assert np.array_equal(SO3.algebra.hat(xi), np.broadcast_to(SO3.algebra.hat(xi[0]), (600, 3, 3)))


@pytest.mark.slow
def test_large_matrices_are_multiplied_or_refused(rng: np.random.Generator) -> None:
    G, g = lm.GL(2), rng.normal(size=(600, 2, 2))
    large = 1e100 * g
    assert np.array_equal(G.compose(large, large), [G.compose(one, one) for one in large])
    g[333] *= 1e200
    with pytest.raises(InvalidInput, match=r"GL\.compose has no finite value at g = "):
        G.compose(g, g)


@record
class Faulty(Record):
    """A formula that works for most rows."""

    scale: float

    def name(self, x: Vec) -> float:
        return self.scale * x[0] if x[0] < 2.0 else undefined * x[1]  # type: ignore[name-defined]  # noqa: F821

    def form(self, x: Vec) -> Any:
        return x if x[0] < 2.0 else x + vec(1.0, 2.0)

    def division(self, x: Vec) -> float:
        return x[1] / (x[0] - 2.0)


@pytest.mark.parametrize("rows", [1, 3, 40, 700])
@pytest.mark.parametrize(("method", "error"), [("name", NameError), ("form", TypeError)])
def test_a_mistake_in_a_formula_is_raised_as_itself(rows: int, method: str, error: type[Exception]) -> None:
    x = np.ones((rows, 3))
    x[-1, 0] = 3.0
    with pytest.raises(error) as caught:
        getattr(Faulty(1.0), method)(x)
    lines = [(frame.path.name, str(frame.statement)) for frame in caught.traceback]
    assert any(name == "test_batch.py" and "x[0] < 2.0" in line for name, line in lines)


@pytest.mark.parametrize("row", [0, 1, 500])
def test_what_has_no_value_is_refused_with_its_row(row: int, rng: np.random.Generator) -> None:
    x = rng.normal(size=(600, 3)) * [0.1, 1.0, 1.0]
    x[row] = 2.0, 7.0, 0.0
    with pytest.raises(
        InvalidInput, match=r"Faulty\.division has no finite value at x = \[2\.0, 7\.0, 0\.0\]: .*division by zero"
    ):
        Faulty(1.0).division(x)


CALLS_OF_ONCE = [0]


@record
class Once(Record):
    """Fails the first time."""

    def value(self, x: Vec) -> float:
        CALLS_OF_ONCE[0] = CALLS_OF_ONCE[0] + 1
        if CALLS_OF_ONCE[0] == 1:
            raise RuntimeError("only once")
        return x[0]


def test_an_exception_that_does_not_repeat_is_not_swallowed() -> None:
    CALLS_OF_ONCE[0] = 0
    with pytest.raises(RuntimeError, match="only once"):
        Once().value(np.ones((600, 3)))


# ------------------------------------------------------------------ when native code is made


@record
class Stubborn(Record):
    """A formula that cannot be compiled."""

    def value(self, x: Vec) -> float:
        try:
            return x[0] / x[1]
        except ZeroDivisionError:
            return 0.0


def test_a_refusal_is_said_once_and_remembered(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    tries = []
    monkeypatch.setattr(
        batch.kernel, "kernel", lambda *a, make=batch.kernel.kernel, **o: (tries.append(1), make(*a, **o))[1]
    )
    x = rng.normal(size=(100, 3))
    with pytest.warns(NotCompiledWarning, match=r"Stubborn\.value runs as plain Python: .*try") as caught:
        first = Stubborn().value(x)
    assert caught[0].filename == __file__
    before = len(tries)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(Stubborn().value(x), first)
    assert before and len(tries) == before


@record
class Counted(Record):
    """A formula whose plain evaluations take a time that tests choose."""

    scale: float

    def value(self, x: Vec) -> float:
        return self.scale * x[0] + x[1] * x[2]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Time that passes by `step` with every plain row, and a cold process."""
    now = {"time": 0.0, "step": 0.0, "rows": 0}
    row = batches.Batch.row

    def counted(self: batches.Batch, i: int) -> Any:
        now["time"], now["rows"] = now["time"] + now["step"], now["rows"] + 1
        return row(self, i)

    monkeypatch.setattr(batches.Batch, "row", counted)
    monkeypatch.setattr(batch.time, "thread_time", lambda: now["time"])
    monkeypatch.setattr(batch, "WORTH", 0.3)
    monkeypatch.setattr(batch, "ROWS", 200)
    monkeypatch.setattr(batch, "NOISE", 0.005)
    for name in ("NATIVE", "REFUSED"):
        monkeypatch.setattr(batch, name, set())
    monkeypatch.setattr(batch, "SECONDS_OF_BATCHES", {})
    monkeypatch.setattr(batch.kernel, "stored", lambda *a, **o: None)
    return now


def test_few_rows_are_not_worth_a_compilation(clock: dict[str, float], rng: np.random.Generator) -> None:
    clock["step"] = 20e-6
    Counted(2.0).value(rng.normal(size=(512, 3)))
    assert clock["rows"] == 512


def test_native_code_takes_over_when_it_pays(clock: dict[str, float], rng: np.random.Generator) -> None:
    clock["step"], x = 20e-6, rng.normal(size=(100_000, 3))
    found = Counted(2.0).value(x)
    assert clock["rows"] < 1000
    assert np.array_equal(found, 2.0 * x[:, 0] + x[:, 1] * x[:, 2])
    clock["rows"] = 0
    Counted(3.0).value(x[:50])  # it is there now, for other parameters too
    assert clock["rows"] == 0


def test_many_small_batches_are_worth_a_compilation_in_the_end(
    clock: dict[str, float], rng: np.random.Generator
) -> None:
    clock["step"], x = 1e-3, rng.normal(size=(100, 3))
    for _ in range(20):
        Counted(2.0).value(x)
    assert 300 < clock["rows"] < 1000


def test_what_is_on_disk_is_used_sooner(
    clock: dict[str, float], monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(batch.kernel, "stored", batch.kernel.kernel)
    clock["step"] = 20e-6
    Counted(2.0).value(rng.normal(size=(8000, 3)))
    assert clock["rows"] < 1000


def test_a_batch_like_one_before_sees_what_it_is_given_now(rng: np.random.Generator) -> None:
    group, other = lm.SO3(), lm.SO3()
    xi, bad = rng.normal(size=(600, 3)), rng.normal(size=(600, 3))
    bad[0, 1] = np.inf
    first = group.exp(np.tile(xi, (700, 1)))[:600]
    for n in 8, 9, 13, 600:
        assert np.array_equal(other.exp(xi[-n:]), first[-n:])
    with pytest.raises(InvalidInput, match=r"xi\[0, 1\] is inf"):
        group.exp(bad)


def test_a_batch_thrown_out_by_another_thread_is_evaluated_all_the_same(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    class Shared(kept.LastUsed):
        """Another thread throws out what was looked up."""

        def get(self, key: Any, default: Any = None) -> Any:
            return self.pop(key, default)

    monkeypatch.setattr(batch, "BATCHES", Shared())
    x = rng.normal(size=(64, 3))
    first = Counted(2.0).value(x)
    assert batch.BATCHES
    assert np.array_equal(Counted(2.0).value(x), first)


@pytest.mark.slow
def test_what_is_remembered_of_a_batch_keeps_no_owner(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(batch, "BATCHES", kept.LastUsed())
    x = rng.normal(size=(64, 3))
    owner = Counted(2.0)
    gone = weakref.ref(owner)
    owner.value(x)
    assert batch.BATCHES
    del owner
    gc.collect()
    assert gone() is None
    assert np.array_equal(Counted(3.0).value(x), 3.0 * x[:, 0] + x[:, 1] * x[:, 2])


def test_the_batch_used_last_is_the_last_to_go(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    monkeypatch.setattr(batch, "BATCHES", kept.LastUsed())
    monkeypatch.setattr(batch, "_of_this_form", lambda _: None)
    x = rng.normal(size=(64, 3))
    Counted(2.0).value(x)
    (form,) = batch.BATCHES
    batch.BATCHES["another"] = batch.BATCHES[form]
    Counted(2.0).value(x)
    assert [*batch.BATCHES] == ["another", form]
