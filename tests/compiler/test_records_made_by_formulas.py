"""Records that formulas make hold what their constructors would make of the values, or are refused."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import pytest
from compiler.worlds import NotCompilable, native, same_in_all_worlds

import liemech as lm
from liemech.formulas import Mat, Record, Vec, record, vec

pytestmark = pytest.mark.compiled


@record
class Point(Record):
    mass: float
    place: Vec
    limits: tuple[float, ...] = (1.0, 2.0)
    spin: float | None = None


@record
class Angle(Record):
    phi: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "phi", self.phi % 1.0)
        super().__post_init__()


@record
class Frame(Record):
    axes: Mat


def numbers_become_floats(x: Any, y: Any, n: Any) -> Any:
    """Of 0 made 0.0 the negative is -0.0; a list becomes a tuple, which does not grow by `+` of Vec."""
    zero, whole = Point(0, vec(0, x)), Point(n, Vec(n, 0), limits=[x, 0])
    signs = [math.copysign(1.0, -v) for v in (zero.mass, zero.place[0], whole.place[1])]
    both = Point(x, vec(x, y), (n, 0), 1)
    return [
        *signs, whole.mass / 2, *(whole.limits + (y,)), math.copysign(1.0, -both.limits[1]),
        both.spin / 2, *(both.place + both.place), both.limits[0] / 4,
    ]  # fmt: skip


def replaced(x: Any, y: Any, n: Any) -> Any:
    moved = dataclasses.replace(Point(x, vec(x, y)), mass=n, place=vec(y, 0))
    return [moved.mass / 2, *moved.place, *moved.limits]


@pytest.mark.parametrize("formula", [numbers_become_floats, replaced])
def test_they_hold_what_the_constructor_makes(formula: Callable[..., Any]) -> None:
    same_in_all_worlds(formula, [[0.5, 2.0], [-1.5, 0.25], [0.0, -0.0]])


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        (lambda x, y, n: Point(x, [x, y]).place[0], r"Point.place .* write liemech.vec\(...\)"),
        (lambda x, y, n: Frame([[x, y], [y, x]]).axes[0, 0], r"Frame.axes .*liemech.mat\(...\)"),
        (lambda x, y, n: Angle(x).phi, "Angle.__post_init__ would run"),
        (lambda x, y, n: lm.RKMK(order=4).tableau.b[0], "RKMK finds its tableau and truncation"),
        (lambda x, y, n: Point("one", vec(x, y)).place[0], "Point.mass is a number"),
    ],
)  # fmt: skip
def test_what_it_would_do_otherwise_is_refused(formula: Callable[..., Any], words: str) -> None:
    with pytest.raises(NotCompilable, match=words):
        native(formula, [[0.5, 2.0]], 1, 3, 1)
