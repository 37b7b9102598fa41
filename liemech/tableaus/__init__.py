"""Coefficients as data: Butcher tableaus, flow tableaus for commutator-free methods, compositions
and splittings.

    lm.tableaus.DORMAND_PRINCE5, lm.tableaus.gauss(3), lm.tableaus.named("Tsitouras 5(4)")

Each is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .butcher import BY_ORDER, FAMILIES, PAIRS, TABLEAUS, named, pair
    from .collocation import gauss, lobatto_iiia, lobatto_iiib, lobatto_iiic, radau_iia
    from .compositions import (
        COMPOSITIONS,
        KAHAN_LI6,
        KAHAN_LI8,
        SUZUKI4,
        SUZUKI_UMENO8,
        TRIPLE_JUMP4,
        YOSHIDA6,
        CompositionTableau,
        suzuki,
        triple_jump,
    )
    from .diagonally_implicit import (
        CROUZEIX3,
        IMPLICIT_EULER,
        IMPLICIT_MIDPOINT,
        SDIRK4,
        TRAPEZOIDAL,
    )
    from .dop853 import DOP853
    from .explicit import (
        BUTCHER6,
        EULER,
        HEUN2,
        HEUN3,
        KUTTA3,
        KUTTA38,
        MIDPOINT,
        RALSTON2,
        RALSTON3,
        RK4,
        SSP3,
    )
    from .flows import (
        CARPENTER_KENNEDY4,
        CF3,
        CF4,
        CG3,
        CG4,
        LIE_EULER,
        LIE_MIDPOINT,
        LUSCHER3,
        FlowTableau,
    )
    from .pairs import (
        BOGACKI_SHAMPINE3,
        BOGACKI_SHAMPINE5,
        CASH_KARP5,
        DORMAND_PRINCE5,
        DVERK6,
        FEHLBERG5,
        HEUN_EULER2,
        ZONNEVELD4,
    )
    from .splittings import (
        BLANES_CASAS_ESCORIHUELA8,
        BLANES_MOAN4,
        BLANES_MOAN4_GENERAL,
        BLANES_MOAN6,
        BLANES_MOAN6_GENERAL,
        BLANES_MOAN6_SHORT,
        RUTH3,
        SPLITTINGS,
        STRANG,
        SYMPLECTIC_EULER,
        SplittingTableau,
    )
    from .tableau import ButcherTableau
    from .trees import order_of
    from .tsitouras import TSITOURAS5
    from .verner import VERNER6, VERNER7

_LATER = {
    "butcher": ("BY_ORDER", "FAMILIES", "PAIRS", "TABLEAUS", "named", "pair"),
    "collocation": ("gauss", "lobatto_iiia", "lobatto_iiib", "lobatto_iiic", "radau_iia"),
    "compositions": (
        *(
            "COMPOSITIONS",
            "KAHAN_LI6",
            "KAHAN_LI8",
            "SUZUKI4",
            "SUZUKI_UMENO8",
            "TRIPLE_JUMP4",
            "YOSHIDA6",
        ),
        *("CompositionTableau", "suzuki", "triple_jump"),
    ),
    "diagonally_implicit": (
        "CROUZEIX3",
        "IMPLICIT_EULER",
        "IMPLICIT_MIDPOINT",
        "SDIRK4",
        "TRAPEZOIDAL",
    ),
    "dop853": ("DOP853",),
    "explicit": (
        *("EULER", "MIDPOINT", "HEUN2", "RALSTON2", "KUTTA3", "HEUN3", "RALSTON3", "SSP3"),
        *("RK4", "KUTTA38", "BUTCHER6"),
    ),
    "flows": (
        *(
            "CARPENTER_KENNEDY4",
            "CF3",
            "CF4",
            "CG3",
            "CG4",
            "LIE_EULER",
            "LIE_MIDPOINT",
            "LUSCHER3",
        ),
        "FlowTableau",
    ),
    "pairs": (
        *(
            "HEUN_EULER2",
            "BOGACKI_SHAMPINE3",
            "ZONNEVELD4",
            "FEHLBERG5",
            "CASH_KARP5",
            "DORMAND_PRINCE5",
        ),
        *("BOGACKI_SHAMPINE5", "DVERK6"),
    ),
    "splittings": (
        *(
            "SPLITTINGS",
            "STRANG",
            "BLANES_MOAN4",
            "BLANES_MOAN6",
            "BLANES_MOAN6_SHORT",
            "BLANES_CASAS_ESCORIHUELA8",
        ),
        *(
            "SYMPLECTIC_EULER",
            "RUTH3",
            "BLANES_MOAN4_GENERAL",
            "BLANES_MOAN6_GENERAL",
            "SplittingTableau",
        ),
    ),
    "tableau": ("ButcherTableau",),
    "trees": ("order_of",),
    "tsitouras": ("TSITOURAS5",),
    "verner": ("VERNER6", "VERNER7"),
}
_HOMES = {name: module for module, names in _LATER.items() for name in names}


def __getattr__(name: str) -> Any:
    """A tableau, imported now."""
    if name not in _HOMES:
        raise AttributeError(f"module 'liemech.tableaus' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})


__all__ = [
    "BLANES_CASAS_ESCORIHUELA8",
    "BLANES_MOAN4",
    "BLANES_MOAN4_GENERAL",
    "BLANES_MOAN6",
    "BLANES_MOAN6_GENERAL",
    "BLANES_MOAN6_SHORT",
    "BOGACKI_SHAMPINE3",
    "BOGACKI_SHAMPINE5",
    "BUTCHER6",
    "BY_ORDER",
    "CARPENTER_KENNEDY4",
    "CASH_KARP5",
    "CF3",
    "CF4",
    "CG3",
    "CG4",
    "COMPOSITIONS",
    "CROUZEIX3",
    "DOP853",
    "DORMAND_PRINCE5",
    "DVERK6",
    "EULER",
    "FAMILIES",
    "FEHLBERG5",
    "HEUN2",
    "HEUN3",
    "HEUN_EULER2",
    "IMPLICIT_EULER",
    "IMPLICIT_MIDPOINT",
    "KAHAN_LI6",
    "KAHAN_LI8",
    "KUTTA3",
    "KUTTA38",
    "LIE_EULER",
    "LIE_MIDPOINT",
    "LUSCHER3",
    "MIDPOINT",
    "PAIRS",
    "RALSTON2",
    "RALSTON3",
    "RK4",
    "SDIRK4",
    "RUTH3",
    "SPLITTINGS",
    "SSP3",
    "STRANG",
    "SUZUKI4",
    "SUZUKI_UMENO8",
    "SYMPLECTIC_EULER",
    "TABLEAUS",
    "TRAPEZOIDAL",
    "TRIPLE_JUMP4",
    "TSITOURAS5",
    "VERNER6",
    "VERNER7",
    "YOSHIDA6",
    "ZONNEVELD4",
    "ButcherTableau",
    "CompositionTableau",
    "FlowTableau",
    "SplittingTableau",
    "gauss",
    "lobatto_iiia",
    "lobatto_iiib",
    "lobatto_iiic",
    "named",
    "order_of",
    "pair",
    "radau_iia",
    "suzuki",
    "triple_jump",
]
