"""Records, small vectors and matrices as Python objects, and the arguments of their methods, where nonsense is refused."""

from __future__ import annotations

import copy
import dataclasses
import enum
import pickle
import sys
import types
from collections.abc import Mapping, Sequence  # noqa: F401  (named in annotations below)
from dataclasses import InitVar
from decimal import Decimal
from fractions import Fraction
from typing import Annotated, Any, ClassVar, ForwardRef, NewType, Optional, TypeAlias

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import batch
from liemech.errors import InvalidInput, InvalidType
from liemech.formulas import Mat, Record, Vec, dot, mat, outer, record, sin, vec
from liemech.formulas.calls import batches
from liemech.formulas.classes.exact_keys import exact_key
from liemech.formulas.classes.fields import FrozenDict
from liemech.formulas.classes.layouts import Layout, layout_of


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


# --- arguments of methods
# --------------------------------------------------------------------------------------------


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


@pytest.mark.slow
@pytest.mark.compiled
def test_many_elements_run_in_native_code_with_the_same_bits(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "WORTH", 0.0)
    monkeypatch.setattr(batch, "ROWS", 0)
    monkeypatch.setattr(batch, "NOISE", 0.0)
    x = rng.normal(size=(1005, 3))
    many = [S.energy(x), S.force(x, 3.0), *S.both(x), S.wave(x)]
    monkeypatch.setattr(batches, "evaluate_rows", batches.in_python)
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


# --- fields
# ----------------------------------------------------------------------------------------------------------


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


class Nothing:
    """Something a record may hold and cannot know."""


@record
class Anything(Record):
    value: Any = None


def annotated(annotation: Any, **names: Any) -> Any:
    """A record whose field `value` has this annotation."""
    body = {"__annotations__": {"value": annotation}, "__module__": __name__, **names}
    return record(type("Annotated", (Record,), body))


V = Vec
Row = tuple[float, ...]
Alias: TypeAlias = "Vec | None"
VECTORS = [
    Vec, lm.Vec, "Vec", "lm.Vec", "V", V | None, "Optional[V]", "None | lm.Vec", Annotated[V, "metres"], "Alias", "'Vec'",
    Optional["Vec"], "Annotated[Vec, 'metres']", NewType("Place", Vec), "Unfindable | Vec", "nowhere.Vec | Vec",
]  # fmt: skip


@pytest.mark.parametrize("annotation", VECTORS, ids=str)
def test_annotations_that_mean_a_vector(annotation: Any) -> None:
    made = annotated(annotation)(np.array([1, 2]))
    assert type(made.value) is Vec and made.value == Vec(1.0, 2.0) and all(type(x) is float for x in made.value)
    assert type(annotated(annotation)([1, np.float64(2)]).value[1]) is float
    assert type(annotated(annotation)(Vec(np.float64(1.0), 2)).value[0]) is float


HELD = [
    ("float", 1, 1.0), (float, np.float64(2.5), 2.5), ("float", np.array(3), 3.0), ("float | None", np.int64(2), 2.0),
    ("float | None", None, None),
    ("int", np.int64(4), 4), (int, np.array(5), 5), ("int | float", 1, 1), ("int | float", 1.5, 1.5),
    ("float | int", np.int64(7), 7),
    ("bool", np.True_, True), ("str", np.str_("a"), "a"), ("int | str", "closed", "closed"),
    ("tuple[float, ...]", [1, 2.5], (1.0, 2.5)), ("Row", np.array([1.0, 2.0]), (1.0, 2.0)), ("tuple", [[1], (2, [3])], ((1,),
    (2, (3,)))),
    ("tuple[Row, ...]", [[1], [2, 3]], ((1.0,), (2.0, 3.0))), ("list[int]", [1, np.int64(2)], (1, 2)),
    ("tuple[int, str]", [1, "a"], (1, "a")),
    ("Sequence[Vec]", [[1, 2]], (Vec(1.0, 2.0),)), ("set[int]", {1, 2}, frozenset({1, 2})),
    ("dict[str, float]", {"a": 1}, {"a": 1.0}),
    ("Mapping[str, Vec]", {"a": [1, 2]}, {"a": Vec(1.0, 2.0)}), ("Any", 1, 1), ("Any", (1, 2.0), (1, 2.0)),
    ("Unfindable", 3, 3),
]  # fmt: skip


@pytest.mark.parametrize(("annotation", "given", "held"), HELD, ids=lambda x: str(x)[:30])
def test_what_a_field_holds(annotation: Any, given: Any, held: Any) -> None:
    found = annotated(annotation)(given).value
    assert found == held and exact_key(found) == exact_key(held if not isinstance(held, dict) else FrozenDict(held))
    hash(found)


@pytest.mark.parametrize(
    ("annotation", "given", "message"),
    [
        ("Any", [1.0], r"Annotated\.value is \[1\.0\], which can be changed in place: annotate the field as lm\.Vec"),
        ("object", {"a": 1}, r"Annotated\.value is .'a': 1., which can be changed in place"),
        ("str", {1}, r"Annotated\.value is .1., which"),
        ("Any", (1, ([2],)), r"Annotated\.value is \[2\], which"),
        ("Unfindable", [1.0], r"nothing is known by its annotation 'Unfindable'"),
        ("Any", np.array([object()]), r"Annotated\.value must be an array of numbers"),
        ("int", 2.0, r"Annotated\.value is an integer; got 2\.0"),
        ("float", np.True_, r"Annotated\.value is a number"),
        ("tuple[float, ...]", 3.0, r"Annotated\.value is a tuple; got 3\.0"),
        ("tuple[float, ...]", ["a"], r"Annotated\.value\[0\] is a number; got 'a'"),
        ("tuple[int, int]", (1, 2, 3), r"Annotated\.value is a tuple of 2 parts"),
        ("dict[str, float]", {"a": "b"}, r"Annotated\.value\['a'\] is a number"),
        ("dict[str, Any]", {"a": [1]}, r"Annotated\.value\['a'\] is \[1\], which"),
    ],
)
def test_a_field_refuses_by_name(annotation: Any, given: Any, message: str) -> None:
    with pytest.raises((InvalidInput, InvalidType), match=message):
        annotated(annotation)(given)


def test_nothing_in_a_field_can_be_changed_in_place() -> None:
    """However it came there: as an argument, from a default factory, or set by the class itself."""

    @record
    class Held(Record):
        table: np.ndarray
        loose: Any
        made: Vec = dataclasses.field(init=False)
        names: dict[str, int] = dataclasses.field(default_factory=dict)
        seed: dataclasses.InitVar[float] = 1.0
        count: ClassVar[int] = 3

        def __post_init__(self, seed: float) -> None:
            super().__post_init__()
            object.__setattr__(self, "made", np.array([seed, 2.0]))
            object.__setattr__(self, "names", {"a": 1})

    source = np.array([[1.0, 2.0]])
    held = Held(source, source[:, ::-1])
    source[:] = 7.0
    assert held.table.tolist() == [[1.0, 2.0]] and held.loose.tolist() == [[2.0, 1.0]] and held.made == Vec(1.0, 2.0)
    again = pickle.loads(pickle.dumps(Anything(source)))
    for copied in (held, copy.copy(held), copy.deepcopy(held), again, dataclasses.replace(held, seed=1.0)):
        for name in {"table", "loose", "value"} & {f.name for f in dataclasses.fields(copied)}:
            with pytest.raises(ValueError, match="read-only"):
                getattr(copied, name)[0, 0] = 5.0
            with pytest.raises(ValueError, match="WRITEABLE"):
                getattr(copied, name).flags.writeable = True
    for change in (lambda d: d.update(b=2), lambda d: d.__setitem__("b", 2), lambda d: d.pop("a"), lambda d: d.clear()):
        with pytest.raises(TypeError, match="cannot be changed"):
            change(held.names)
    assert pickle.loads(pickle.dumps(held.names)) == {"a": 1}

    @record
    class Forgetful(Record):
        made: Any = dataclasses.field(init=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "made", [1.0])

    @record
    class ByHand(Record):
        made: Any

        def __init__(self, made: Any) -> None:
            object.__setattr__(self, "made", made)

    for make in (Forgetful, lambda: ByHand([1.0])):
        with pytest.raises(InvalidType, match=r"\.made is \[1\.0\], which can be changed in place"):
            make()


def test_a_class_that_converts_its_own_field_after_super() -> None:
    @record
    class Table(Record):
        rows: Any

        def __post_init__(self) -> None:
            super().__post_init__()
            object.__setattr__(self, "rows", tuple(self.rows))

    assert Table([1, 2]).rows == (1, 2)


def test_a_record_without_its_decorator_is_refused() -> None:
    class Bare(Record):
        stiffness: float

    class Empty(Record):
        pass

    @dataclasses.dataclass
    class Changeable(Record):
        stiffness: float

    class More(Spring):
        extra: InitVar[float]

    for make in (Bare, lambda: Empty(), lambda: Changeable(1.0), lambda: More(1.0)):
        with pytest.raises(InvalidType, match=r"put @liemech\.record above"):
            make()

    class Fine(Spring):
        kind: ClassVar[int] = 3

    assert Fine(1.0).kind == 3


def test_a_method_that_a_field_would_hide_is_refused() -> None:
    class Pushed(lm.models.HeavyTop):
        def load(self, t: float, xi: Any, g: Any) -> Any:
            return lm.vec(0.1, 0.0, 0.0)

    class Derived(lm.models.HeavyTop):
        @property
        def weight(self) -> float:
            return 2.0

    with pytest.raises(InvalidType, match=r"Pushed\.load is a method .* load is a field.*load=\.\.\."):
        Pushed([1.0, 1.0, 0.5], 2.0, [0.0, 0.0, 1.0])
    with pytest.raises(InvalidType, match=r"Derived\.weight is a method or a property"):
        Derived([1.0, 1.0, 0.5], 2.0, [0.0, 0.0, 1.0])
    assert Given().n == 5


@lm.record
class Counted(lm.Record):
    n: int = dataclasses.field(init=False)


@lm.record
class Given(Counted):
    @property
    def n(self) -> int:  # type: ignore[override]
        return 5


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="no simulation where it is so")
def test_annotations_that_are_computed_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """PEP 649, Python 3.14, simulated: a class has no `__annotations__`, and what is not known yet is a ForwardRef."""
    library = types.ModuleType("annotationlib")
    library.Format = types.SimpleNamespace(FORWARDREF="forward references")  # type: ignore[attr-defined]
    library.get_annotations = lambda thing, format: getattr(thing, "__annotate__", lambda _: {})(format)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "annotationlib", library)
    made = annotated(ForwardRef("Vec | None"))
    del made.__annotations__
    made.__annotate__ = staticmethod(lambda format: {"forward references": {"value": ForwardRef("Vec | None")}}[format])
    monkeypatch.setattr(sys, "version_info", (3, 14, 0))
    assert made([1, 2]).value == Vec(1.0, 2.0) and made(None).value is None

    class Bare(Record):
        __annotate__ = staticmethod(lambda format: {"stiffness": float})

    with pytest.raises(InvalidType, match=r"Bare has the fields stiffness: put @liemech\.record above"):
        Bare()

    def force(self: Any, x: Any) -> Any:
        return x + x

    force.__annotate__ = lambda format: {"x": ForwardRef("lm.Vec"), "return": ForwardRef("NotYet")}  # type: ignore[attr-defined]
    assert hasattr(type("Forced", (Spring,), {"force": force}).force, "__formula__")


class Colour(enum.Enum):
    RED = 1
    BLUE = 1.0 + 1e-12


class Loud(float):
    def __repr__(self) -> str:
        return "Loud"


class Quiet:
    def __repr__(self) -> str:
        return "quiet"


STATICS = [
    1, True, 1.0, np.float64(1.0), np.float32(1.0), np.int64(1), np.True_, 1 + 0j, Fraction(1), Decimal(1), Decimal("1.0"),
    Colour.RED, "1", b"1", (1,),
    (True,), (1.0,), ((1,),), frozenset({1}), frozenset({1.0}), FrozenDict(a=1), FrozenDict(a=1.0), range(1), range(0, 1, 2),
    slice(1), None,
    0.0, -0.0, (0.0,), (-0.0,), 0j, -0j, float("nan"), float("inf"), 0.3, 0.1 + 0.2, np.float64(0.3), np.float64(0.1 + 0.2),
    2**70, 2**70 + 1,
    Fraction(1, 3), Fraction(1, 3) + Fraction(1, 10**30), Decimal("0.1"), Decimal("0.1") + Decimal("1e-25"), Colour.BLUE,
    np.array([1.0, 2.0]),
    np.array([1.0, 2.0 + 1e-15]), np.array([1, 2]), np.arange(2000.0), np.arange(2000.0) + np.eye(1, 2000, 1000)[0] * 1e-9,
    Quiet(), Quiet(), len,
    np.sin, pickle, Colour, Spring(1.0), Spring(1.0 + 1e-9), Spring(1.0).energy, Spring(2.0).energy, Vec(1.0), Mat((1.0,)),
    [1], [1],
]  # fmt: skip


def test_statics_are_told_apart_by_type_and_value() -> None:
    layouts = [Layout("static", (), thing) for thing in STATICS]
    for i, a in enumerate(layouts):
        for j, b in enumerate(layouts):
            assert (a == b) is (i == j), (STATICS[i], STATICS[j])
            assert i != j or hash(a) == hash(b)


def test_equal_statics_are_one() -> None:
    for thing in STATICS:
        if not isinstance(thing, (Quiet, list)):
            again = pickle.loads(pickle.dumps(thing)) if thing is not pickle else thing
            assert Layout("static", (), again) == Layout("static", (), thing), thing
            assert hash(Layout("static", (), again)) == hash(Layout("static", (), thing)), thing


@record
class Constants(Record):
    """Statics of different kinds in the formula y = a x + b."""

    slope: tuple[float, ...]
    offset: Any

    def energy(self, x: Vec) -> float:
        return self.slope[0] * x[0] + float(self.offset)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Constants((1.0,), np.float32(1)), Constants((1.0,), np.float32(1) + np.finfo(np.float32).eps)),
        (Constants((1.0,), 0), Constants((1.0 + 1e-9,), 0)),
        (Constants((1.0,), Loud(1.0)), Constants((1.0,), Loud(1.0 + 1e-9))),
        (Constants((Loud(1.0),), 0), Constants((Loud(1.0 + 1e-9),), 0)),
    ],
    ids=["NumPy scalars", "tuples", "a silent number", "silent numbers in a tuple"],
)
def test_the_derivative_by_a_static_parameter_is_not_zero(
    one: Any, other: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("WORTH", "ROWS", "NOISE"):  # native code is made at once
        monkeypatch.setattr(batch, name, 0)
    x = np.ones((600, 2))
    assert (one.energy(x) != other.energy(x)).all()
    assert one.energy(x)[0] == one.energy(x[0]) and other.energy(x)[0] == other.energy(x[0])


def test_what_is_remembered_beside_the_fields_is_not_seen() -> None:
    fresh, used = Spring(2.0, rest=(1, 0, 0)), Spring(2.0, rest=(1, 0, 0))
    layout = layout_of(used)
    assert layout_of(used) is layout and vars(used) == vars(fresh) and pickle.dumps(used) == pickle.dumps(fresh)
    assert vars(copy.deepcopy(used)) == vars(fresh) and copy.copy(used) == fresh

    @record
    class Eager(Record):
        rest: Any

        def __post_init__(self) -> None:
            layout_of(self)  # before it is complete
            object.__setattr__(self, "rest", Vec(1.0, 2.0, 3.0))

    assert layout_of(Eager(1.0)).parts[0].width == 3


def test_annotations_of_methods_in_every_form() -> None:
    spaces = {"__name__": __name__, "V": Vec, "lm": lm, "Optional": Optional}
    spaces |= {x.__name__: x for x in (Vec, Record, record, Any, Annotated)}
    forms = (
        "Vec",
        "lm.Vec",
        "V",
        "Optional[V]",
        "'Vec'",
        "V | None",
        "Annotated[Vec, 3]",
        "lm.formulas.Element",
        "None | lm.Vec",
    )
    for annotation in forms:
        for future in ("from __future__ import annotations\n", ""):
            text = f"{future}@record\nclass Made(Record):\n    def twice(self, x: {annotation}, other: Any = None): return x + x\n"
            space: dict[str, Any] = dict(spaces)
            exec(text, space)
            result = (
                space["Made"]().twice(np.array([1.0, 2.0])) if "Element" not in annotation else np.array([2.0, 4.0])
            )
            assert isinstance(result, np.ndarray) and hasattr(space["Made"].twice, "__formula__"), (annotation, future)
    others = {"str": "a", "dict[str, Vec]": {"a": [1.0]}, "Unfindable": [1.0, 2.0], "tuple[Vec, ...]": ()}
    for annotation, given in others.items():  # not broadcast
        space = dict(spaces)
        text = f"from __future__ import annotations\n@record\nclass Made(Record):\n    def twice(self, x: {annotation}): return x\n"
        exec(text, space)
        assert space["Made"]().twice(given) is given


def test_records_are_frozen_compare_and_say_what_they_are() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        S.stiffness = 3.0  # type: ignore[misc]
    same, other = Spring(2.0, rest=(1, 0, 0)), Spring(2.0)
    assert same == S and hash(same) == hash(S) and other != S and Stiff(2.0) != other
    assert {S: "a"}[same] == "a"
    assert repr(other) == "Spring(stiffness=2.0, rest=Vec(0.0, 0.0, 0.0), shear=None, order=2, label='spring')"
    assert dataclasses.replace(S, stiffness=5).stiffness == 5.0


@record
class Scaled(Record):
    """A field that only its name gives comes before those that their places give."""

    scale: float = dataclasses.field(default=5.0, kw_only=True)
    first: float = 1.0
    second: float = 2.0

    def total(self, mu: Vec) -> float:
        return self.first * mu[0] ** 2 + self.second * mu[1] ** 2 + self.scale * mu[2] ** 2


@record
class ByPlace(lm.Hamiltonian):
    """A record that the formula makes, its fields by their places."""

    first: float

    def energy(self, mu: Vec) -> float:
        return Scaled(self.first, 0.7).total(mu)


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_places_of_fields_do_not_count_those_that_are_given_by_name(compiled: bool) -> None:
    """Native code took the first number for the field that has no place."""
    mu = np.array([0.5, 0.4, 0.8])
    made, known = (lm.LiePoissonSystem(lm.SO3(), h) for h in (ByPlace(3.0), lm.KineticEnergy([1 / 6, 1 / 1.4, 0.1])))
    ends = [
        lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.01, steps=2, compiled=compiled).mu[-1]
        for system in (made, known)
    ]
    assert np.allclose(*ends, rtol=1e-13, atol=0.0)


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


# --- small vectors and matrices
# --------------------------------------------------------------------------------------


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
        lambda v, m: v + vec(1.0, 2.0, 3.0),
        lambda v, m: v + (1.0, 2.0, 3.0),
        lambda v, m: m + v,
        lambda v, m: m + mat(vec(1.0, 2.0)),
        lambda v, m: m @ vec(1.0, 2.0, 3.0),
        lambda v, m: v @ vec(1.0),
        lambda v, m: v + "ab",
    ],
)
def test_what_cannot_be_combined(nonsense) -> None:
    with pytest.raises(TypeError):
        nonsense(vec(1.0, 2.0), mat(vec(1.0, 2.0), vec(3.0, 4.0)))
