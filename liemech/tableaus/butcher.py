"""All Butcher tableaus of the library: by name, by order, and the pairs for adaptive steps."""

from __future__ import annotations

from ..errors import InvalidInput, InvalidType
from ..formulas.calls.arguments import ordinary
from . import diagonally_implicit, explicit, pairs
from .collocation import gauss, lobatto_iiia, lobatto_iiib, lobatto_iiic, radau_iia
from .tableau import ButcherTableau

BY_ORDER = {
    1: explicit.EULER,
    2: explicit.MIDPOINT,
    3: explicit.KUTTA3,
    4: explicit.RK4,
    5: pairs.DORMAND_PRINCE5,
    6: pairs.VERNER6,
    7: pairs.VERNER7,
    8: pairs.DOP853,
}
"""The explicit method that `RKMK(order=...)` stands for; fixed steps are made with `.bare`."""

PAIRS = {
    2: pairs.HEUN_EULER2,
    3: pairs.BOGACKI_SHAMPINE3,
    4: pairs.ZONNEVELD4,
    5: pairs.DORMAND_PRINCE5,
    6: pairs.VERNER6,
    7: pairs.VERNER7,
    8: pairs.DOP853,
}
"""The explicit method of each order that estimates its error."""

TABLEAUS = {
    t.name: t
    for module in (explicit, pairs, diagonally_implicit)
    for t in vars(module).values()
    if isinstance(t, ButcherTableau)
}
"""The explicit and the diagonally implicit methods by name; Gauss, Radau and Lobatto methods are made by functions."""

FAMILIES = {
    "Gauss": gauss,
    "Radau IIA": radau_iia,
    "Lobatto IIIA": lobatto_iiia,
    "Lobatto IIIB": lobatto_iiib,
    "Lobatto IIIC": lobatto_iiic,
}
"""The fully implicit methods: functions of the number of stages."""


def named(name: str) -> ButcherTableau:
    """The tableau of this name, such as "Tsitouras 5(4)", "Gauss 6" or "classical"; upper case and
    brackets do not matter.

    Raises InvalidInput with the nearest names.
    """
    if not isinstance(name, str):
        raise InvalidType(f'a tableau is called by its name, such as "classical"; got {name!r}')
    by_name = {_plain(part): t for n, t in TABLEAUS.items() for part in (n, n.partition("(")[0])}
    plain_name = _plain(name)
    for family, family_of in FAMILIES.items():
        order = plain_name.removeprefix(_plain(family))
        if plain_name.startswith(_plain(family)) and order.isdecimal():
            stages = {"Gauss": int(order), "Radau IIA": int(order) + 1}.get(family, int(order) + 2)
            if stages % 2 == 0:
                return family_of(stages // 2)
            raise InvalidInput(
                f"{family} methods are of {'odd' if family == 'Radau IIA' else 'even'} order; got {name!r}"
            )
    if plain_name not in by_name:
        import difflib  # when needed, for an import does not wait for it

        near = dict.fromkeys(by_name[n].name for n in difflib.get_close_matches(plain_name, by_name, 3, 0.5))
        all_names = [*TABLEAUS, *(f"{family} <order>" for family in FAMILIES)]
        raise InvalidInput(
            f"no tableau is called {name!r}; {'near are' if near else 'there are'} {', '.join(near or all_names)}"
        )
    return by_name[plain_name]


def pair(order: int) -> ButcherTableau:
    """The explicit method of this order with an error estimate.  Raises InvalidInput with the orders there are."""
    order = ordinary(order)
    if type(order) is not int or order not in PAIRS:
        raise InvalidInput(f"no pair of order {order!r}; there are pairs of the orders {', '.join(map(str, PAIRS))}")
    return PAIRS[order]


def _plain(name: str) -> str:
    return "".join(x for x in name.lower() if x.isalnum())


__all__ = ["BY_ORDER", "FAMILIES", "PAIRS", "TABLEAUS", "ButcherTableau", "named", "pair"]
