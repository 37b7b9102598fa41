"""Sites that meet with power series: what they publish goes on term by term, and so does what others make
of it.

The terms of order k of all sites need those before of their neighbours.  So sites meet once for each
order: a meeting of numbers, as any other, at which everything that was asked of the series gets its next
term.  Sums over neighbours and pairs in loops of native code are made anew for each order, of all terms
so far; the numbers of single neighbours are kept.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 13.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from ..classes.layouts import build, layout_of, leaves
from ..classes.taken_back import noted
from ..vectors import Vec
from .bases import is_any_number
from .series import Series


def has_series(value: Any) -> bool:
    """Whether there are power series among the numbers of a value."""
    return any(type(x) is Series for x in leaves(value, layout_of(value, _number)))


def _number(x: Any) -> bool:
    return type(x) is Series or is_any_number(x)


def company(holder: Any) -> list[SeriesMeeting]:
    """The list of the meetings of series in the formula that runs, which its holder keeps; a new list where meetings in
    it have met again: those to come do not go on with them.
    """
    if holder.company is None or any(len(x.meetings) > 1 for x in holder.company):
        holder.company = []
    return holder.company


class SeriesMeeting:
    """Series that all sites have published at one place of a formula; asked like a `Meeting` of numbers.

    meet : of numbers.  call : calls a method of a `Meeting`, or a formula of what it gives.
    methods : those of a `Meeting`.  company : the meetings of series in one formula, in their order, which
    go on together: a site may need the terms of none of them, as one that is held.
    """

    def __init__(
        self, value: Any, meet: Any, call: Callable[..., Any], methods: Any, company: list[SeriesMeeting]
    ) -> None:
        self.meet, self.call, self.methods, self.company = meet, call, methods, company
        self.layout = layout_of(value, _number)
        self.leaves = leaves(value, self.layout)
        self.meetings: list[Any] = []
        self.asked: list[tuple[Any, list[list[Any]]]] = []
        self.summed = False  # are there sums, made of all terms so far?
        self.inside: tuple[Any, int] | None = None  # a sum that is being made, and the order
        company.append(self)
        noted(company.pop)
        self._meet_again()

    # -------------------------------------------------------------- what is asked

    def of(self, table: Any, d: Any) -> Any:
        """The value of the site that is number d of this site's entries in a table."""
        return self._of_one(lambda met: self.call(self.methods.of, met, table, d))

    def at(self, j: Any) -> Any:
        """The value of site j, the same for all who ask."""
        return self._of_one(lambda met: self.call(self.methods.at, met, j))

    def sum(self, table: Any, formula: Any, start: Any) -> Any:
        """start + formula(b, d) + ... over this site's entries in a table."""
        return self._sums(self.methods.sum, formula, start, (table,), (), 1)

    def some(self, formula: Any, start: Any, reach: Any, mine: Any = None) -> Any:
        """start + formula(b, j) + ... over the sites j of a range."""
        return self._sums(self.methods.some, formula, start, (), (reach, mine), 1)

    def pairs(self, formula: Any, start: Any) -> Any:
        """start + ... over all pairs of this site with another one."""
        return self._sums(self.methods.pairs, formula, start, (), (), 2)

    # -------------------------------------------------------------- order by order

    def reach(self, k: int) -> None:
        """Let all meet up to the order k."""
        for order in range(1, k + 1):
            for meeting in self.company:
                if len(meeting.meetings) == order:
                    meeting._meet_again()

    def _meet_again(self) -> None:
        """Meet at the next order; all that was asked gets its next terms."""
        order = len(self.meetings)
        self.meetings.append(self.meet(self._published(order)))
        noted(self.meetings.pop)
        for ask, terms in self.asked:
            self._answer(ask, terms, order)

    def _published(self, k: int) -> tuple[Any, ...]:
        if self.summed or k == 0:
            return tuple([c for x in self.leaves for c in self._terms(x, k)])
        return tuple([x[k] for x in self.leaves if type(x) is Series])

    @staticmethod
    def _terms(x: Any, k: int) -> list[Any]:
        return [x[j] for j in range(k + 1)] if type(x) is Series else [x]

    def _answer(self, ask: Any, terms: list[list[Any]], k: int) -> None:
        terms.append(ask(self.meetings[k], k))
        noted(terms.pop)

    def _asks(self, ask: Any) -> list[list[Any]]:
        """The terms of an answer, as far as sites have met, and from now on."""
        terms: list[list[Any]] = []
        for k in range(len(self.meetings)):
            self._answer(ask, terms, k)
        self.asked.append((ask, terms))
        noted(self.asked.pop)
        return terms

    def _series(self, terms: list[list[Any]], i: int) -> Series:
        def term(k: int) -> Any:
            self.reach(k)
            return terms[k][i]

        return Series(terms[0][i]).by(term)

    def _of_one(self, value_in: Callable[[Any], Any]) -> Any:
        """The series of one site, from its numbers at each meeting."""
        if self.inside is not None:
            return self._polynomials(value_in(self.inside[0]), self.inside[1])

        def ask(met: Any, k: int) -> list[Any]:
            numbers = iter(value_in(met))
            if self.summed and k > 0:
                numbers = iter(self._last(numbers, k))
            return [next(numbers) if k == 0 or type(x) is Series else None for x in self.leaves]

        terms = self._asks(ask)
        parts = [self._series(terms, i) if type(x) is Series else terms[0][i] for i, x in enumerate(self.leaves)]
        return build(self.layout, iter(parts))

    def _last(self, numbers: Any, k: int) -> list[Any]:
        """The last of the terms of every series that was published."""
        rows = [(x, [next(numbers) for _ in self._terms(x, k)]) for x in self.leaves]
        return [row[-1] for x, row in rows if type(x) is Series]

    def _polynomials(self, numbers: Any, k: int) -> Any:
        """A published value up to the order k."""
        coefficients = iter(numbers)
        parts = [
            Series(*[next(coefficients) for _ in range(k + 1)]) if type(x) is Series else next(coefficients)
            for x in self.leaves
        ]
        return build(self.layout, iter(parts))

    def _sums(
        self, method: Any, formula: Any, start: Any, before: tuple[Any, ...], behind: tuple[Any, ...], ends: int
    ) -> Any:
        """A sum of the values of a formula, made anew at each meeting, of which the last term counts.

        ends : for how many sites the formula gives values.
        """
        if not self.summed:
            self.summed = True
            noted(functools.partial(setattr, self, "summed", False))

        def ask(met: Any, k: int) -> list[Any]:
            def of_order(*values: Any) -> Any:
                outer, self.inside = self.inside, (met, k)
                try:
                    sites = [self._polynomials(x, k) for x in values[:ends]]
                    value = self.call(formula, *sites, *values[ends:])
                finally:
                    self.inside = outer
                return Series.coefficient(value, k)

            sums = self.call(method, met, *before, of_order, Series.coefficient(start, k), *behind)
            return list(sums) if isinstance(sums, Vec) else [sums]

        terms = self._asks(ask)
        series = [self._series(terms, i) for i in range(len(terms[0]))]
        return Vec(*series) if isinstance(start, Vec) else series[0]
