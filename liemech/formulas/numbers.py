"""What all numbers of formulas share: stand-ins for a float, and numbers made of a value and something beside it."""

from __future__ import annotations

from typing import Any


class StandIn:
    """Base of what takes the place of a float whose value is not known yet: the compiler's numbers."""

    __slots__ = ()

    def elementary(self, name: str, *x: Any) -> Any:
        """The elementary function of this name, of numbers of which one is `self`."""
        raise NotImplementedError


class ByValue:
    """A number with a `value`; what else it carries plays no part in comparisons."""

    __slots__ = ()
    value: Any

    def __lt__(self, other: Any) -> Any:
        return self.value < _value(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= _value(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > _value(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= _value(other)

    def __eq__(self, other: object) -> Any:
        return self.value == _value(other)

    def __ne__(self, other: object) -> Any:
        return self.value != _value(other)

    __hash__ = None  # type: ignore[assignment]


def _value(x: Any) -> Any:
    return x.value if isinstance(x, ByValue) else x
