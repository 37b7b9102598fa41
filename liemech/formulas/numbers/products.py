"""Products of power series, several at a time where numbers can lie side by side.

    (a b)_k = sum_j a_j b_(k-j)

In native code most of the time of a Taylor step goes into these sums.  There the terms of several
series lie in one register, and several products cost about as much as one.  Each is the same sum in
the same order as alone, so no bit differs.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 13 (convolutions).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ..classes.taken_back import noted
from .bases import StandIn

FIRST = 3
"""The term of a product from which it is computed beside others: by then it is known which products
are wanted.  They have been asked for their term 1.
"""
LEAST, MOST = 4, 8
"""How many products are computed as one: eight numbers fill the largest register."""
PAIR = 8
"""The term from which on two are, of less than `LEAST`: before, packing takes as long as it saves."""


class TermByTerm(Protocol):
    """A power series as products ask for it: term by term."""

    def term(self, k: int) -> Any:
        """The coefficient c_k; None if there is no such term."""


def cauchy(a: TermByTerm, b: TermByTerm, k: int, first: int = 0) -> Any:
    """The Cauchy product, sum_j a_j b_(k-j) over j >= first; a term of b is not looked at where a
    has none.

    From the middle outwards: what was computed last is added last, so that the sums of one order
    need not wait for those of the order before.  And a b has the bits of b a.
    """
    square = a is b and not first  # every mixed product occurs twice
    half, odd = divmod(k, 2)
    middle = _times(a, half, b, half) if not odd and half >= first else None
    total = None if square else middle
    for j in range(half - 1 + odd, -1, -1):
        pair = _times(a, k - j, b, j)
        if j >= first and not square:
            pair = plus(_times(a, j, b, k - j), pair)
        total = plus(total, pair)
    return plus(None if total is None else total + total, middle) if square else total


def _times(a: TermByTerm, i: int, b: TermByTerm, j: int) -> Any:
    x = a.term(i)
    y = None if x is None else b.term(j)
    return None if y is None else x * y


def plus(a: Any, b: Any) -> Any:
    """a + b, of terms that may not be there."""
    return b if a is None else a if b is None else a + b


class Products:
    """The products of the series of one calculation.

    Those of one rank do not need each other's terms of the same order, so they can be computed
    together, if their factors begin alike.
    """

    def __init__(self) -> None:
        self._known: list[_Product] = []
        self._in_rows = False

    def joined(self, a: TermByTerm, b: TermByTerm, rank: int) -> Callable[[int], Any]:
        """The terms of one more product, a b."""
        product = _Product(a, b, rank)
        self._known.append(product)
        noted(self._known.pop)

        def term(k: int) -> Any:
            if k >= FIRST and not self._in_rows:
                self._put_in_rows()
            return product.term(k)

        return term

    def _put_in_rows(self) -> None:
        self._in_rows = True
        noted(self._alone_again)
        by_form: dict[Any, list[_Product]] = {}
        for product in self._known:
            if product.wanted:
                by_form.setdefault(product.form, []).append(product)
        for products in by_form.values():
            for begin in range(0, len(products), MOST):
                group = products[begin : begin + MOST]
                if len(group) >= LEAST:
                    _RowsOfProducts(group, FIRST)
                elif len(group) > 1:
                    _RowsOfProducts(group[:2], PAIR)

    def _alone_again(self) -> None:
        self._in_rows = False
        for product in self._known:
            product.rows = None


class _Product:
    """A product a b, alone or in rows of products."""

    def __init__(self, a: TermByTerm, b: TermByTerm, rank: int) -> None:
        self.factors, self.rank = (a, b), rank
        self.wanted = False
        self.rows: _RowsOfProducts | None = None
        self.place = 0

    @property
    def form(self) -> tuple[Any, ...]:
        """The rank and the first terms, which products have in common that are computed together."""
        a, b = self.factors
        return self.rank, a is b, *[x.term(k) is None for x in (a, b) for k in range(FIRST)]

    def term(self, k: int) -> Any:
        """The term k of the product, computed in its rows of products if it has some."""
        if k > 0 and not self.wanted:
            self.wanted = True
            noted(functools.partial(setattr, self, "wanted", False))
        terms = self.rows.terms(k) if self.rows and k >= self.rows.first else None
        return terms[self.place] if terms else cauchy(*self.factors, k)


class _RowsOfProducts:
    """Products a b side by side: one product of two series whose terms are rows of numbers.

    first : the first term that is computed so.
    """

    def __init__(self, products: Sequence[_Product], first: int) -> None:
        self.first = first
        left, right = zip(*[product.factors for product in products])
        self._left = _Row(left)
        self._right = self._left if left[0] is right[0] else _Row(right)
        self._found: dict[int, Sequence[Any] | None] = {}
        for place, product in enumerate(products):
            product.rows, product.place = self, place

    def terms(self, k: int) -> Sequence[Any] | None:
        """The terms k of the products; None if they must be computed one by one."""
        if k not in self._found:
            try:
                row = cauchy(self._left, self._right, k)
            except _Unlike:
                row = None
            self._found[k] = None if row is None else row.apart()
            noted(functools.partial(self._found.pop, k))
        return self._found[k]


class _Unlike(Exception):
    """Raised where terms cannot lie side by side."""


class _Row:
    """Series side by side: the term k is the row of their terms k."""

    def __init__(self, series: Sequence[TermByTerm]) -> None:
        self._series = series
        self._terms: list[Any] = []

    def term(self, k: int) -> Any:
        """The row of the terms k; None if none of them is there.  Raises _Unlike."""
        while len(self._terms) <= k:
            self._terms.append(self._beside([x.term(len(self._terms)) for x in self._series]))
            noted(self._terms.pop)
        return self._terms[k]

    def _beside(self, terms: list[Any]) -> Any:
        absent = [c is None for c in terms]
        if all(absent):
            return None
        of_run = next((c for c in terms if isinstance(c, StandIn)), None)
        row = None if of_run is None or any(absent) else of_run.beside(terms)
        if row is None:
            raise _Unlike
        return row
