"""An object that a formula asks for its class may get another one; and objects that are called."""

from collections.abc import Callable
from typing import Any

import pytest
from compiler.worlds import native, plain

pytestmark = pytest.mark.compiled


class Soft:
    stiffness = 1.0

    def __call__(self, x: Any) -> Any:
        return self.stiffness * x


class Hard:
    stiffness = 10.0

    def __call__(self, x: Any) -> Any:
        return self.stiffness * x + x**3


spring: Any = Soft()


def by_type(x: Any, n: Any) -> Any:
    return x if type(spring) is Soft else 7.0 * x


def by_isinstance(x: Any, n: Any) -> Any:
    return x if isinstance(spring, (int, Soft)) else 7.0 * x


def by_attribute(x: Any, n: Any) -> Any:
    return x if spring.__class__ is Soft else 7.0 * x


def by_name(x: Any, n: Any) -> Any:
    return x if type(spring).__name__ == "Soft" else 7.0 * x


def by_calling_it(x: Any, n: Any) -> Any:
    return spring(x)


@pytest.mark.parametrize("formula", [by_type, by_isinstance, by_attribute, by_name, by_calling_it])
def test_another_class_is_seen(formula: Callable[..., Any]) -> None:
    found = []
    for kind in (Soft, Hard, Soft):
        spring.__class__ = kind
        found += native(formula, [[2.0]], 1, 3, 1)
        assert found[-1] == plain(formula, [2.0], 3)
    assert found[0] == found[2] != found[1]
