"""Coefficients as data: Butcher tableaus, flow tableaus for commutator-free methods, compositions
and splittings.

    lm.tableaus.DORMAND_PRINCE5, lm.tableaus.gauss(3), lm.tableaus.named("Tsitouras 5(4)")

Each is imported when it is first asked for.
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
