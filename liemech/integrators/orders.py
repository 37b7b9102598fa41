"""The order of a method, which is one of several that it has, or that of its tableau.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.1.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ..errors import InvalidInput, require


def require_order(method: Any, orders: Collection[int], more: str = "") -> None:
    """Raise InvalidInput unless the order of a method is one of these.  more : what the message says of them."""
    if type(method.order) is not int or method.order not in orders:
        raise InvalidInput(f"{type(method).__name__}: order is one of {sorted(orders)}{more}; got {method.order!r}")


def set_tableau(method: Any, kind: type, choices: Mapping[int, Any], more: str = ", or give a tableau") -> Any:
    """The tableau of a method, that of its order where none is given; its order becomes that of the tableau.

    kind : of tableau.  choices : tableaus by their order.  Raises InvalidInput for an order without one, InvalidType
    for what is no such tableau.
    """
    if method.tableau is None:
        require_order(method, choices, more)
        object.__setattr__(method, "tableau", choices[method.order])
    tableau: Any = method.tableau
    require(f"{type(method).__name__}: tableau", tableau, kind)
    object.__setattr__(method, "order", method.tableau.order)
    return tableau
