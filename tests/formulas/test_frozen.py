"""`frozen` beside `dataclasses.dataclass(frozen=True)`: classes of every ordinary kind, made by both,
cannot be told apart; and records made in odd ways.
"""

from __future__ import annotations

import abc
import copy
import dataclasses
import functools
import inspect
import pickle
import typing
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, InitVar, dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import pytest

import liemech as lm
from liemech.formulas.classes.frozen import frozen

Decorator = Callable[[type], type]
T = TypeVar("T")


def plain(make: Decorator) -> tuple[type, list[tuple[tuple[Any, ...], dict[str, Any]]]]:
    @make
    class Plain:
        """A point."""

        x: float
        y: float = 2.0

    return Plain, [((1.0,), {}), ((1.0, 3.0), {}), ((), {"y": 5.0, "x": 1}), ((), {}), ((1, 2, 3), {})]


def nothing(make: Decorator) -> Any:
    @make
    class Nothing:
        pass

    return Nothing, [((), {}), ((1,), {}), ((), {"x": 1})]


def one(make: Decorator) -> Any:
    @make
    class One:
        only: Any

    return One, [((1.0,), {}), (((1.0,),), {}), (([],), {})]


def factories(make: Decorator) -> Any:
    @make
    class Factories:
        xs: list[int] = field(default_factory=lambda: [1, 2])
        hidden: int = field(default=3, repr=False, compare=False)
        count: int = field(default=4, init=False)
        made: tuple[int, ...] = field(default_factory=tuple, init=False)
        hashed: int = field(default=1, hash=False)
        noted: int = field(default=1, metadata={"unit": "kg"})

    return Factories, [((), {}), (((7,), 8), {}), ((), {"count": 1}), (((),), {"hashed": 2})]


def by_name(make: Decorator) -> Any:
    @make
    class ByName:
        x: int
        _: KW_ONLY
        y: int = 1
        z: int
        place: int = field(default=0, kw_only=False)

    return ByName, [((1,), {"z": 2}), ((1, 2), {"z": 3}), ((1,), {}), ((1, 2, 3), {"z": 1})]


def pseudo(make: Decorator) -> Any:
    @make
    class Pseudo:
        law: ClassVar[str] = "Euler"
        other: typing.ClassVar[int] = 3
        scale: InitVar[float]
        x: float = 1.0
        shift: dataclasses.InitVar[float] = 0.5

        def __post_init__(self, scale: float, shift: float) -> None:
            object.__setattr__(self, "x", self.x * scale + shift)

    return Pseudo, [((2.0,), {}), ((2.0, 3.0, 4.0), {}), ((), {}), ((1,), {"law": 2})]


def inherited(make: Decorator) -> Any:
    @make
    class Base:
        a: int
        b: int = 2

        def __repr__(self) -> str:
            return "a base"

    class Between(Base):
        c: int = 3  # of a class that nobody has decorated

    @make
    class Derived(Between):
        d: int = 4
        a: float = 0.5

    return Derived, [((), {}), ((1, 2, 3), {}), ((1, 2, 3, 4), {}), ((), {"c": 2})]


def several(make: Decorator) -> Any:
    @make
    class Left:
        x: int = 1

    @make
    class Right:
        y: int = 2

    @make
    class Both(Left, Right):
        z: int = 3

    return Both, [((), {}), ((1, 2, 3), {}), ((), {"y": 5})]


def own_methods(make: Decorator) -> Any:
    @make
    class OwnMethods:
        x: int

        def __init__(self, *x: int) -> None:
            object.__setattr__(self, "x", sum(x))

        def __eq__(self, other: object) -> bool:
            return isinstance(other, type(self)) and abs(self.x) == abs(other.x)

        def __repr__(self) -> str:
            return f"<{self.x}>"

    return OwnMethods, [((1, 2, 3), {}), ((-6,), {}), ((), {}), ((), {"x": 1})]


def own_hash(make: Decorator) -> Any:
    @make
    class OwnHash:
        x: int
        __match_args__ = ("x", "x")

        def __hash__(self) -> int:
            return 7

    return OwnHash, [((1,), {}), ((2,), {})]


def unhashable(make: Decorator) -> Any:
    @make
    class Unhashable:
        x: int
        __hash__ = None  # type: ignore[assignment]

    return Unhashable, [((1,), {})]


def slots(make: Decorator) -> Any:
    @make
    class Slots:
        __slots__ = ("x", "y")
        x: int
        y: int

    return Slots, [((1, 2), {}), ((1,), {})]


def generic(make: Decorator) -> Any:
    @make
    class Holder(Generic[T]):
        item: T
        tag: str = ""

    return Holder, [((1,), {}), (("x", "y"), {})]


def abstract(make: Decorator) -> Any:
    class Shape(abc.ABC):
        @abc.abstractmethod
        def __repr__(self) -> str: ...

        @property
        @abc.abstractmethod
        def side(self) -> float: ...

    @make
    class Square(Shape):
        size: float = 1.0

        @functools.cached_property
        def side(self) -> float:
            return self.size

    return Square, [((), {}), ((2.0,), {})]


def named_self(make: Decorator) -> Any:
    @make
    class NamedSelf:
        self: int
        cls: int = 1

    return NamedSelf, [((1,), {}), ((), {"self": 2})]


def descriptor(make: Decorator) -> Any:
    class Three:
        def __get__(self, owner: Any, cls: Any = None) -> int:
            return 3

    @make
    class Described:
        x: int = Three()  # type: ignore[assignment]

    return Described, [((), {})]


def mutable(make: Decorator) -> Any:
    @make
    class Mutable:
        xs: list[int] = []  # noqa: RUF012

    return Mutable, []


def wrong_order(make: Decorator) -> Any:
    @make
    class WrongOrder:
        x: int = 1
        y: int

    return WrongOrder, []


def not_annotated(make: Decorator) -> Any:
    @make
    class NotAnnotated:
        x = field(default=1)

    return NotAnnotated, []


def own_setattr(make: Decorator) -> Any:
    @make
    class OwnSetattr:
        x: int

        def __setattr__(self, name: str, value: Any) -> None: ...

    return OwnSetattr, []


def twice_by_name(make: Decorator) -> Any:
    @make
    class Twice:
        _: KW_ONLY
        x: int
        __: KW_ONLY

    return Twice, []


def of_one_that_can_change(make: Decorator) -> Any:
    @dataclass
    class Free:
        x: int = 1

    @make
    class Bound(Free):
        y: int = 2

    return Bound, []


def of_a_dataclass(make: Decorator) -> Any:
    @dataclass(frozen=True)
    class First:
        x: int = 1

    @make
    class Second(First):
        y: int = 2

    return Second, [((), {}), ((3, 4), {})]


def a_dataclass_of_it(make: Decorator) -> Any:
    @make
    class First:
        x: int = 1

    @dataclass(frozen=True, order=True)
    class Second(First):
        y: int = 2

    return Second, [((), {}), ((3, 4), {})]


def made_by_exec(make: Decorator) -> Any:
    space: dict[str, Any] = {"make": make, "__name__": __name__}
    exec("@make\nclass InACell:\n    x: 'int'\n    y: 'int' = 2", space)
    return space["InACell"], [((1,), {}), ((), {})]


KINDS = [
    *(plain, nothing, one, factories, by_name, pseudo, inherited, several, own_methods, own_hash),
    *(unhashable, slots, generic, abstract, named_self, descriptor, mutable, wrong_order),
    *(not_annotated, own_setattr, twice_by_name, of_one_that_can_change, of_a_dataclass),
    *(a_dataclass_of_it, made_by_exec),
]


def outcome(action: Callable[[], Any]) -> Any:
    """What it gives, or the error that it raises, in words."""
    try:
        return repr(action())
    except Exception as error:
        return type(error), str(error).replace(".__create_fn__.<locals>", "")


def looked_at(make: Decorator, kind: Any) -> Iterator[Any]:
    """All that can be seen of a class, and of the objects that it makes."""
    try:
        cls, calls = kind(make)
    except Exception as error:
        yield type(error), str(error)
        return
    yield cls.__name__, cls.__doc__, cls.__match_args__, cls.__hash__ is None
    yield str(inspect.signature(cls))
    yield sorted(cls.__abstractmethods__) if hasattr(cls, "__abstractmethods__") else None
    yield [
        (f.name, f.type, f.init, f.repr, f.hash, f.compare, f.kw_only, dict(f.metadata))
        for f in dataclasses.fields(cls)
    ]
    yield [(f.name, f.default) for f in dataclasses.fields(cls)]
    yield {f.name: outcome(functools.partial(getattr, cls, f.name)) for f in dataclasses.fields(cls)}
    made = []
    for args, options in calls:
        yield outcome(lambda args=args, options=options: cls(*args, **options))
        try:
            made.append(cls(*args, **options))
        except TypeError:
            continue
    for x in made:
        yield outcome(lambda x=x: hash(x)), outcome(lambda x=x: dataclasses.asdict(x))
        yield [outcome(lambda x=x, y=y: (x == y, x != y)) for y in [*made, None, 3]]
        yield outcome(lambda x=x: copy.copy(x)), outcome(lambda x=x: copy.deepcopy(x))
        yield outcome(lambda x=x: copy.copy(x) == x)
        for name in [f.name for f in dataclasses.fields(cls)] + ["unknown"]:
            yield outcome(lambda x=x, name=name: setattr(x, name, 1))
            yield outcome(lambda x=x, name=name: delattr(x, name))
            yield outcome(lambda x=x, name=name: dataclasses.replace(x, **{name: 9}))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_frozen_class_is_a_frozen_dataclass(kind: Any) -> None:
    ours, theirs = list(looked_at(frozen, kind)), list(looked_at(dataclass(frozen=True), kind))
    assert ours == theirs


def test_subclasses_that_nobody_decorated_may_have_attributes_of_their_own() -> None:
    for make in (frozen, dataclass(frozen=True)):

        @make
        class Base:
            x: int = 1

        class Loose(Base):
            pass

        loose = Loose()
        loose.note = "free"  # type: ignore[attr-defined]
        assert loose.note == "free"  # type: ignore[attr-defined]
        del loose.note  # type: ignore[attr-defined]
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'x'"):
            loose.x = 2


def test_the_constructor_of_a_base_that_has_made_nothing_yet_is_its_own() -> None:
    """It is made when it is first asked for, by whomever."""

    @frozen
    class Base:
        x: int

    class Derived(Base):
        def __init__(self, y: int) -> None:
            super().__init__(y + 1)

    assert Derived(1).x == 2 and Base(5).x == 5
    assert inspect.signature(Base) == inspect.signature(frozen(type("B", (), {"__annotations__": {"x": "int"}})))


def test_a_class_of_no_module() -> None:
    """Its annotations are texts here, for which `dataclasses` looks into the module."""
    space: dict[str, Any] = {"lm": lm, "__name__": "nowhere"}
    body = "    law: ClassVar[int] = 3\n    k: float = 1.0\n    _: KW_ONLY\n    v: tuple = (1, 2)\n"
    energy = "    def energy(self, mu): return self.k * lm.dot(mu, mu)"
    exec(f"@lm.record\nclass InACell(lm.Hamiltonian):\n{body}{energy}", space)
    made = space["InACell"](2)
    assert repr(made) == "InACell(k=2.0, v=(1, 2))" and made.energy([1, 2, 3]) == 28.0
    with pytest.raises(TypeError, match="positional argument"):
        space["InACell"](2, (3, 4))


def test_a_class_that_has_made_nothing_yet_can_be_sent_to_other_processes() -> None:
    cloudpickle = pytest.importorskip("cloudpickle")

    @lm.record
    class Sent(lm.Hamiltonian):
        k: float = 2.0
        m: float = field(default_factory=lambda: 3.0)

        def energy(self, mu: lm.Vec) -> float:
            return self.k * self.m * lm.dot(mu, mu)

    there = cloudpickle.loads(cloudpickle.dumps(Sent))
    assert str(inspect.signature(there)) == str(inspect.signature(Sent))
    assert there().energy([1, 0, 1]) == 12.0 and there(1, m=1).energy([1, 0, 1]) == 2.0


def test_an_object_that_holds_itself_can_be_shown() -> None:
    @frozen
    class Ring:
        parts: list[Any]

    parts: list[Any] = []
    ring = Ring(parts)
    parts.append(ring)
    assert repr(ring).count("Ring(parts=[") == 1 and "..." in repr(ring)


@lm.record
class Weighted(lm.Hamiltonian):
    weights: lm.Vec
    names: tuple[str, ...] = ()
    _: KW_ONLY
    scale: float = 1.0
    table: np.ndarray = field(default_factory=lambda: np.arange(3.0), compare=False)

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * self.scale * lm.dot(mu, mu * self.weights)


@lm.record
class Shifted(Weighted):
    shift: lm.Vec = lm.vec(0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", 2 * self.scale)
        super().__post_init__()

    def energy(self, mu: lm.Vec) -> float:
        return super().energy(mu - self.shift)


@lm.record
class Sized(Weighted):
    def __init__(self, *weights: float) -> None:
        super().__init__(weights, scale=len(weights))


@pytest.mark.parametrize(
    "made",
    [Weighted([1, 2, 3], ["a"], scale=2), Shifted((1, 2, 3), shift=np.ones(3)), Sized(1, 2, 3)],
    ids=lambda made: type(made).__name__,
)
def test_records_survive_what_people_do_with_dataclasses(made: Any) -> None:
    mu = lm.vec(0.3, -0.2, 0.5)
    for other in (pickle.loads(pickle.dumps(made)), copy.copy(made), copy.deepcopy(made)):
        assert other == made and hash(other) == hash(made) and repr(other) == repr(made)
        assert other.energy(mu) == made.energy(mu) and not other.table.flags.writeable
    assert [f.name for f in dataclasses.fields(made)][:4] == ["weights", "names", "scale", "table"]
    assert dataclasses.is_dataclass(made) and isinstance(made.weights, lm.Vec)
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.scale = 3.0


def test_fields_of_records_are_replaced() -> None:
    made = Weighted([1, 2, 3])
    assert dataclasses.replace(made, scale=4).scale == 4.0 and made.scale == 1.0
    assert Shifted([1, 2, 3], scale=3).scale == 6.0
    assert Sized(1, 2).scale == 2.0 and Sized(1, 2).weights == lm.vec(1.0, 2.0)


@pytest.mark.parametrize(
    "wrong, says",
    [
        (lambda: lm.RigidBody(inertias=[1, 2, 3]), r"RigidBody\(\) .*'inertias'. Did you mean 'inertia'"),
        (lambda: lm.RKMK(ordr=4), r"RKMK\(\) .*'ordr'. Did you mean 'order'"),
        (lambda: Shifted([1.0], shfit=[2.0]), "'shfit'. Did you mean 'shift'"),
        (lambda: Sized(wieghts=[1.0]), "'wieghts'; it takes none"),
        (lambda: lm.SO3().dexp([1, 2, 3], [1, 2, 3], sde="left"), "SO3.dexp.*Did you mean 'side'"),
    ],
)
def test_a_misspelt_keyword_is_answered_with_the_nearest(wrong: Any, says: str) -> None:
    with pytest.raises(lm.errors.InvalidType, match=says) as caught:
        wrong()
    assert isinstance(caught.value, TypeError)


def test_a_misspelt_option_of_a_run_is_answered_with_the_nearest_one():
    body = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy([1.0, 1.5, 2.0]))
    start, method = body.state([0.3, 0.5, 0.7]), lm.RKMK(order=4)
    plan = lm.Plan(body, method, h=0.1)
    for call, said in (
        (lambda: lm.integrate(body, method, start, h=0.1, step=3), "integrate.*'step'.*'steps'"),
        (lambda: lm.Plan(body, method, h=0.1, rtoll=1e-6), "Plan.*'rtoll'.*'rtol'"),
        (lambda: plan.run(start, t_ende=1.0), "Plan.run.*'t_ende'.*'t_end'"),
        (lambda: plan.resume(plan.run(start, steps=1), step=1), "Plan.resume.*'step'.*'steps'"),
        (lambda: lm.check_group(lm.SO3(), nativ=True), "check_group.*'nativ'.*'native'"),
    ):
        with pytest.raises(TypeError, match=said):
            call()
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'start'"):
        plan.run(steps=3)


@lm.record
class Looked(lm.Potential):
    """An energy that reads an array, and arrays in a tuple."""

    table: np.ndarray
    pair: tuple[np.ndarray, ...] = ()

    def energy(self, g):
        return float(self.table[0]) * g[0, 0]


def test_records_with_arrays_are_compared_by_their_entries():
    """As dataclasses and NumPy leave it, `==` and `hash` raise."""
    first, second = (Looked(np.arange(3.0), (np.eye(2), np.zeros((0, 2)))) for _ in range(2))
    assert first == second and hash(first) == hash(second) and {first: 1}[second] == 1
    assert pickle.loads(pickle.dumps(first)) == first
    others = np.arange(1.0, 4.0), np.arange(4.0), np.arange(3.0)[:, None], np.zeros(1)
    assert not any(first == dataclasses.replace(first, table=np.array(other)) for other in others)
    assert first != dataclasses.replace(first, pair=(np.eye(2), np.zeros((0, 3))))
    assert Looked(np.zeros((0, 2))) == Looked(np.zeros((0, 2))) != Looked(np.zeros((2, 0)))


def test_systems_whose_edges_are_given_are_compared():
    chains = [
        lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Tied().over(lm.neighbours.edges(np.array(pairs)))))
        for pairs in ([[0, 1], [1, 2]], [[0, 1], [1, 2]], [[0, 1], [0, 2]])
    ]
    assert chains[0] == chains[1] != chains[2] and hash(chains[0]) == hash(chains[1])


@lm.record
class Tied(lm.Term):
    """An exchange of spins."""

    def energy(self, a, b):
        return -lm.dot(a.mu, b.mu)
