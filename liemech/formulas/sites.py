"""Sites, the parts of one system: formulas of one site, in which it meets the others.

A formula of a site publishes what others need of it (`meet`), asks for what they have published,
for its own parameters (`own`), for sums over all sites (`total`), for sweeps (`repeated`), and for what one formula finds
for all of them (`once`).  In plain Python every site runs again and again, up to what it asks next; native code divides
the formula into loops over the sites there.  Both give the same bits.

All sites ask alike: not in a branch or a loop of unknown length, and before a site saves anything.  What was published
may be asked for up to the next `meet` or `once`; what a site has computed is kept across all words.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextvars import copy_context
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from .classes.layouts import build, carried_layout, leaves
from .classes.records import Record, record
from .functions import where
from .numbers.conversions import as_others_see
from .numbers.series_of_sites import SeriesMeeting, company, has_series
from .numbers.transposes import ruled
from .sums import halves
from .tables import Table
from .vectors import Vec

TOGETHER = 16
"""Sites that may run side by side: sums over all sites are so many sums, each of every sixteenth site."""


EIGHT = 8
"""Sites that meet eight others side by side, where all pairs are taken."""


def padded(count: int) -> int:
    """The length of a row of numbers of `count` sites: whole groups of sixteen, and an odd number of these, so that the
    rows do not compete for the same places of a cache.
    """
    return TOGETHER * (-(-count // TOGETHER) | 1)


LINE = 64
"""Bytes of a line of the cache: eight numbers that begin on one are loaded at once."""


def room(*shape: int, dtype: Any = np.float64) -> np.ndarray:
    """An array of zeros that begins on a line of the cache, as all its rows then do."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    bytes_ = np.zeros(size + LINE, dtype=np.uint8)
    begin = -bytes_.__array_interface__["data"][0] % LINE
    return bytes_[begin : begin + size].view(dtype).reshape(shape)


WORTH = 2**14
"""Numbers of an array that are worth the microsecond which it takes to find a line of the cache: a vector that native code
writes at once lies in one line there, and in two where arrays of NumPy begin, in three of four processes.
"""


def in_lines(*shape: int) -> np.ndarray:
    """An array of floats to be filled; a large one begins a line."""
    return np.empty(shape) if math.prod(shape) < WORTH else room(*shape)


def rows_of(values: np.ndarray) -> np.ndarray:
    """Rows of numbers, one number for each site in the last axis, with the places behind the last site filled by it."""
    count = values.shape[-1]
    rows = room(*values.shape[:-1], padded(count), dtype=values.dtype)
    rows[..., :count], rows[..., count:] = values, values[..., -1:]
    return rows


# ------------------------------------------------------------------ parameters of sites


@record
class SiteTable(Record):
    """Whole numbers of every site: the numbers of its neighbours, or of the edges that lead there.  Made by
    `SiteTable.of`.
    """

    entries: Any  # (degree, sites) integers of four bytes, in rows of length `places`
    rows: float  # the degree, the number of entries of a site
    places: float
    reach: Any  # of eight sites at a time, how their entries lie in memory: `reach_of`
    # the degree, if formulas may know it, whose loops over it are then written out; None where runs may differ in it
    degree: int | None = None

    def __post_init__(self) -> None:
        """Raises InvalidInput for tables that are not as long as the numbers say: native code does not look."""
        super().__post_init__()
        rows, places = self.rows, self.places
        sound = _in_rows(self.entries, places) and 2 * len(self.entries) == rows * places
        if sound and self.degree in (None, rows) and self.numbers.min(initial=0) >= 0:
            reach = reach_of(self.numbers.reshape(int(rows), int(places)))
            if isinstance(self.reach, Table) and self.reach.content == reach.tobytes():
                return
        raise InvalidInput("SiteTable: its tables do not fit its rows, places and degree; make it by SiteTable.of")

    @classmethod
    def of(cls, entries: Any, fixed: bool = True) -> SiteTable:
        """The table of an array of whole numbers, (degree, sites).  fixed : is the degree known to
        formulas?  Raises InvalidInput.
        """
        indices = np.asarray(entries)
        if indices.ndim != 2 or indices.dtype.kind not in "iu" or not indices.shape[1]:
            raise InvalidInput(
                "SiteTable: entries are whole numbers, (degree, sites), of at least one site; got "
                f"{indices.dtype} of shape {indices.shape}"
            )
        if indices.size and not (indices.min() >= 0 and indices.max() < 2**31):
            raise InvalidInput("SiteTable: entries are not negative, and less than 2^31")
        rows = rows_of(indices.astype(np.int32))
        degree = len(indices) if fixed else None
        table = Table(rows.view(np.float64).ravel())
        reach = Table(reach_of(rows).view(np.float64).ravel())
        return cls(table, float(len(indices)), float(rows.shape[1]), reach, degree)

    @property
    def numbers(self) -> np.ndarray:
        """The entries, row by row, (degree * places,)."""
        return self.entries.array.view(np.int32)

    @property
    def largest(self) -> int:
        """The largest entry; -1 if there is none."""
        return int(self.numbers.max(initial=-1))

    def fits(self, count: int) -> bool:
        """Whether the places of a row are those of `count` sites, `padded`."""
        return self.places == padded(count)


FAR = -(2**31)
"""In place of a reach: of entries that lie far from each other."""


def reach_of(entries: np.ndarray) -> np.ndarray:
    """The way in which the entries of every eight sites lie, so that native code need not look: the first of them if
    they follow each other; else ~(the first of sixteen among which all of them are), which is negative; or `FAR`.
    """
    eights = entries.reshape(len(entries), entries.shape[1] // EIGHT, EIGHT)
    firsts = eights[..., 0]
    least = np.minimum(eights.min(axis=-1), entries.shape[1] - TOGETHER)
    follow = (eights - firsts[..., None] == np.arange(EIGHT)).all(axis=-1)
    near = (eights.max(axis=-1) - least) < TOGETHER
    return np.where(follow, firsts, np.where(near, ~least, FAR)).astype(np.int32)


def _in_rows(table: Any, places: float) -> bool:
    """Whether a table is a `Table`, and its rows have a `padded` number of places."""
    return isinstance(table, Table) and places > 0.0 and places % TOGETHER == 0.0


@record
class SiteArray(Record):
    """Numbers of every site, or of every edge of every site; `own` gives a formula those of its site.  Made by
    `SiteArray.of`.
    """

    entries: Any  # (dim, places) numbers
    places: float
    dim: int | None = None  # the number of components; None for single numbers

    def __post_init__(self) -> None:
        """Raises InvalidInput for a table whose size is no multiple of `places`."""
        super().__post_init__()
        if not (_in_rows(self.entries, self.places) and len(self.entries) % (self.places * (self.dim or 1)) == 0):
            raise InvalidInput("SiteArray: its table does not fit its places and dim; make it by SiteArray.of")

    @classmethod
    def of(cls, values: Any, edges: bool = False) -> SiteArray:
        """The numbers of an array, (sites,) or (sites, dim); of edges (degree, sites) or (degree,
        sites, dim).  Raises InvalidInput.
        """
        numbers = np.asarray(values, dtype=np.float64)
        axes = numbers.ndim - edges
        if axes not in (1, 2) or not numbers.shape[int(edges)]:
            raise InvalidInput(
                f"SiteArray: values have shape ({'degree, ' * edges}sites) or ({'degree, ' * edges}"
                f"sites, dim), with at least one site; got {numbers.shape}"
            )
        rows = rows_of(np.moveaxis(numbers, -1, -2) if axes == 2 else numbers)
        dim = numbers.shape[-1] if axes == 2 else None
        return cls(Table(rows.ravel()), float(rows.shape[-1]), dim)

    def fits(self, count: int) -> bool:
        """Whether the places of a row are those of `count` sites, `padded`."""
        return self.places == padded(count)


# ------------------------------------------------------------------ the words of formulas


def meet(value: Any) -> Any:
    """Publish a value of this site, a number, a vector, a record of numbers; the meeting gives what
    other sites have published in the same place of the formula.  Power series meet once an order.

    Numbers that carry a derivative along are published with it, unless this site moves alone.
    """
    visit = _visit("meet")
    if has_series(value):
        return SeriesMeeting(value, meet, lambda formula, *x: formula(*x), Meeting, company(visit))
    return Meeting(visit.ask("meet", as_others_see(value)), visit.site)


def met_through(k: int) -> None:
    """Let this site meet with its power series up to the order k, though it may need no terms of others."""
    visit = _present.visit
    if visit is not None and visit.company:
        visit.company[-1].reach(k)


class Meeting:
    """Values that all sites have published at one place of a formula."""

    __slots__ = ("published", "site")

    def __init__(self, published: Any, site: Any) -> None:
        self.published, self.site = published, site

    def of(self, table: SiteTable, d: int) -> Any:
        """The value of the site that is number d of this site's entries in a table."""
        return self.at(_entry(table, d, self.site))

    def at(self, j: int) -> Any:
        """The value of site j, the same for all who ask."""
        return self.published[j]

    def sum(self, table: SiteTable, formula: Callable[[Any, int], Any], start: Any) -> Any:
        """start + formula(b, d) + ... over this site's entries in a table, in their order; b is the
        value of the site that is number d of them.
        """
        sum_ = start
        for d in range(rows_in(table)):
            sum_ = sum_ + formula(self.of(table, d), d)
        return sum_

    def some(self, formula: Callable[[Any, int], Any], start: Any, reach: Vec, mine: float | None = None) -> Any:
        """start + formula(b, j) + ... over the sites j of a range, in their order; b is what site j has
        published.

        reach : the first of them and the one behind the last.  mine : the number of this site, if it is
        one of them, which is left out.
        """
        sum_, begin = start, int(reach[0])
        for j in range(begin, int(reach[1])):
            if mine is None:
                sum_ = sum_ + formula(self.at(j), j)
            else:
                is_self = mine == j
                other = where(is_self, self.at(j - 1 if j > begin else begin + 1), self.at(j))
                sum_ = where(is_self, sum_, sum_ + formula(other, j))
        return sum_

    def pairs(self, formula: Callable[[Any, Any], tuple[Any, Any]], start: Any) -> Any:
        """start + ... over all pairs of this site with another one; formula(a, b) gives what the first
        and what the second of two sites get, of what they have published.

        Sites go by eights, so that native code can take each pair once, for both of its sites, side by
        side: the sums here are in that order (`chains_of_partners`).
        """
        sum_ = start
        for chains in chains_of_partners(self.site, _visit("pairs").count):
            sums = [sum_, *[start - start for _ in chains[1:]]]
            for k, chain in enumerate(chains):
                for j, first in chain:
                    ends = (self.site, j) if first else (j, self.site)
                    sums[k] = sums[k] + formula(self.at(ends[0]), self.at(ends[1]))[not first]
            sum_ = halves(sums)
        return sum_


def chains_of_partners(i: int, count: int) -> Iterator[list[list[tuple[int, bool]]]]:
    """The partners of site i, eight by eight, each as chains of (j, whether i comes first), one for each of the
    sums that are then added by halves.

    Eight sites meet eight others in a ring, which is turned by one place after each meeting.  Of one,
    two or up to four sites that are left over, 1, 2 or 4 places fill the ring again and again: then it
    is turned as often, and each of these places has several sums.
    """
    group, place = divmod(i, EIGHT)
    last, left = divmod(count, EIGHT)
    period_of_last = period_of(left) if 0 < 2 * left <= EIGHT else EIGHT
    for other in range(-(-count // EIGHT)):
        first = other >= group
        period = period_of_last if last in (group, other) else EIGHT
        begins = [place] if first else range(place, place + EIGHT, period)
        yield [
            [
                (j, first)
                for turn in range(period)
                for j in [other * EIGHT + ((begin + turn) % period if first else (begin - turn) % EIGHT)]
                if j != i and j < count
            ]
            for begin in begins
        ]


def period_of(sites: int) -> int:
    """The least power of two, up to four, that is not less than a number of sites."""
    return 1 if sites == 1 else 2 if sites == 2 else 4


def rows_in(table: SiteTable) -> int:
    """The number of entries that a site has in a table."""
    return int(table.rows) if table.degree is None else table.degree


def own(array: Any, d: int | None = None) -> Any:
    """The value of this site in an array of parameters; with d the value of its edge d."""
    site = _visit("own").site
    if isinstance(array, SiteTable):
        return _entry(array, d or 0, site)
    if not isinstance(array, SiteArray):
        raise InvalidType(f"own: a SiteArray or a SiteTable; got {array!r}")
    dim, places = array.dim or 1, int(array.places)
    first = (d or 0) * dim
    numbers = [array.entries.array.item((first + k) * places + site) for k in range(dim)]
    return numbers[0] if array.dim is None else Vec.of(numbers)


def total(value: Any) -> Any:
    """The sum over all sites of a number, a vector, a record of numbers; of one body alone the value
    itself.

    Sixteen sums, each of every sixteenth site, are added by halves: the same bits with any number
    of lanes and workers.
    """
    return ruled(sum_over_sites, _total_back, None, (), value)


def sum_over_sites(value: Any) -> Any:
    """`total`, without the rule of its way back."""
    visit = _present.visit
    return value if visit is None else visit.ask("total", value)


def _total_back(value: Any, w: Any) -> Any:
    """The sum of what all sites feel."""
    return (sum_over_sites(w),), []


def mean(value: Any) -> Any:
    """The mean over all sites of a number or a vector: `total` over their number; of one body alone
    the value itself.
    """
    visit = _present.visit
    return value if visit is None else total(value) / float(visit.count)


def repeated(
    sweep: Callable[[Any], tuple[Any, Any]],
    unknown: Any,
    judge: Callable[[Any, Any], tuple[Any, Any]],
    state: Any,
    turns: int,
) -> tuple[Any, Any]:
    """An unknown, swept again and again, until a judge says of what the sweeps tell, in total over all
    sites, that it is enough; and the last state of the judge.

    sweep : gives a new unknown, and what it tells.  judge : gives of its state and of that a new
    state, and whether it is enough.  turns : the most there may be.
    """
    visit = _present.visit
    if visit is not None:
        return visit.ask("repeated", (sweep, unknown, judge, state, turns))[visit.site]
    for _ in range(turns):
        unknown, summands = sweep(unknown)
        state, enough = judge(state, total(summands))
        if enough:
            break
    return unknown, state


def once(formula: Callable[..., None], question: Any, value: Any, answer: Any, *args: Any) -> Any:
    """All sites have come here, each with a value in the column `question`; a formula runs once for all of them, in which
    they may be looped over; and each goes on with its value in the column `answer`.  Columns that the formula sets are
    asked for in no other way.  One thread makes such steps.
    """
    visit = _visit("once")
    return visit.ask("once", (formula, question, value, answer, args))[visit.site]


def _entry(table: SiteTable, d: int, site: int) -> int:
    return int(table.numbers[d * int(table.places) + site])


# ------------------------------------------------------------------ plain Python


class _Asked(BaseException):
    """A question of a site, where nobody has the answer yet; no formula catches it."""


class Visit:
    """One evaluation of a formula for one of `count` sites, with the answers of other sites that are known so far.

    answers : to the first questions, by the kind of each.  company : the last meetings of power series.
    """

    company: list[SeriesMeeting] | None = None

    def __init__(self, site: int, count: int, answers: list[tuple[str, Any]]) -> None:
        self.site, self.count, self.answers, self.asked = site, count, answers, 0

    def ask(self, kind: str, value: Any) -> Any:
        """The answer to the next question; raises _Asked if there is none yet."""
        if self.asked == len(self.answers):
            raise _Asked(kind, value)
        before, answer = self.answers[self.asked]
        if before != kind:
            raise InvalidInput(f"site {self.site} asks for `{kind}` where others ask for `{before}`")
        self.asked += 1
        return answer


class _Present(threading.local):
    """The visit of this thread, if there is one."""

    visit: Visit | None = None


_present = _Present()


def _visit(word: str) -> Visit:
    if _present.visit is None:
        raise InvalidInput(
            f"{word}: there is no site here: formulas of sites are run by `integrate`, for all sites together"
        )
    return _present.visit


def present_site() -> int:
    """The site whose formula runs."""
    return _visit("present_site").site


def each_site(count: int, formula: Callable[..., Any], *args: Any) -> None:
    """Run a formula for every site, from meeting to meeting.  Its errors have the number of the site, `site`."""
    answers: list[tuple[str, Any]] = []
    while True:
        requests = [_visited(i, count, answers, formula, args) for i in range(count)]
        kinds = [kind for kind, _ in requests]
        if len({*kinds}) > 1:
            i = next(i for i, kind in enumerate(kinds) if kind != kinds[0])
            raise InvalidInput(
                f"sites part ways: site 0 asks for {kinds[0]} where site {i} asks for {kinds[i]}; "
                "conditions around `meet` and `total` are the same for all sites"
            )
        if kinds[0] == "nothing":
            return
        values = [value for _, value in requests]
        answers.append((kinds[0], _ANSWERS[kinds[0]](values)))


def some_sites(count: int, begin: int, end: int, formula: Callable[..., Any], *args: Any) -> None:
    """Run a formula for the sites from `begin` to `end`, which meet once; the others rest, and publish only."""
    requests = [_visited(i, count, [], formula, args) for i in range(begin, end)]
    if all(kind == "nothing" for kind, _ in requests):
        return
    everyone = {i: requests[i - begin] for i in range(begin, end)}
    for i in range(count):
        if i not in everyone:
            everyone[i] = _visited(i, count, [], formula, args)
    published = [("meet", [everyone[i][1] for i in range(count)])]
    again = [_visited(i, count, published, formula, args) for i in range(begin, end)]
    if any(kind != "nothing" for kind, _ in again) or any(k != "meet" for k, _ in requests):
        raise InvalidInput("where some sites rest, formulas `meet` once, with what is known before")


class _Some(dict[int, Any]):
    """Values that sites have published at one place, as far as they have come there.

    number : of the place.  visit : lets a site come as far as to a place.
    """

    def __init__(self, number: int, visit: Callable[[int, int], Any]) -> None:
        super().__init__()
        self.number, self.visit = number, visit

    def __missing__(self, site: int) -> Any:
        self.visit(site, self.number)
        return self[site]


FEW = 2000
"""Sites that are all visited for the sake of one, which asks for a total."""


class TooManySites(Exception):
    """One site asks for a total over more than a few, or for sweeps."""


class _Early(Visit):
    """A visit of one site where most others have not been visited.

    until : the question after which it may end.  visit : lets another site come as far as to one.
    """

    def __init__(self, site: int, count: int, answers: list[tuple[str, Any]], until: int, visit: Any) -> None:
        super().__init__(site, count, answers)
        self.until, self.visit = until, visit

    def ask(self, kind: str, value: Any) -> Any:
        if kind in ("repeated", "once"):
            raise TooManySites
        if self.asked == len(self.answers):
            self.answers.append((kind, _Some(self.asked, self.visit)))
        published = self.answers[self.asked][1]
        published[self.site] = value
        if self.asked == self.until:
            raise _Asked(kind, value)
        if kind == "total" and self.count > FEW:
            raise TooManySites
        published = super().ask(kind, value)
        return _added([published[i] for i in range(self.count)]) if kind == "total" else published


def one_site(count: int, site: int, formula: Callable[..., Any], *args: Any) -> Any:
    """The value of a formula for one of the sites; other sites are evaluated as far as it asks them."""
    answers: list[tuple[str, Any]] = []
    outside = copy_context()  # of the derivatives that one site is taking another knows nothing

    def visited(i: int, until: int) -> Any:
        before, _present.visit = _present.visit, _Early(i, count, answers, until, visited)
        try:
            return outside.copy().run(formula, *args)
        except _Asked:
            return None
        except Exception as error:
            _placed(error, i)
            raise
        finally:
            _present.visit = before

    return visited(site, -1)


def _placed(error: Any, site: int) -> None:
    """Let the error of a formula say for which site, and which other one it had met there, None if none."""
    if hasattr(error, "site"):
        return
    error.site, error.beside = site, None
    trace = error.__traceback__
    while trace is not None:
        code, variables = trace.tb_frame.f_code, trace.tb_frame.f_locals
        if code is Meeting.sum.__code__:
            error.beside = _entry(variables["table"], variables["d"], site)
        elif code in (Meeting.some.__code__, Meeting.pairs.__code__):
            error.beside = variables["j"]
        trace = trace.tb_next


def _visited(site: int, count: int, answers: list[Any], formula: Any, args: tuple[Any, ...]) -> tuple[str, Any]:
    """The next question of a site, and the value it gives for it."""
    before, _present.visit = _present.visit, Visit(site, count, answers)
    try:
        formula(*args)
    except _Asked as question:
        kind, value = question.args
        return kind, value
    except Exception as error:
        _placed(error, site)
        raise
    finally:
        _present.visit = before
    return "nothing", None


def _swept(requests: list[Any]) -> list[Any]:
    """The unknowns of all sites and the last state of the judge, where all of them ask for sweeps."""
    unknowns = [unknown for _, unknown, *_ in requests]
    _, _, judge, state, turns = requests[0]
    answers: list[Any] = [None for _ in requests]

    def sweep_one() -> None:
        i = present_site()
        answers[i] = requests[i][0](unknowns[i])

    for _ in range(turns):
        each_site(len(requests), sweep_one)
        unknowns = [unknown for unknown, _ in answers]
        state, enough = judge(state, _added([summand for _, summand in answers]))
        if enough:
            break
    return [(unknown, state) for unknown in unknowns]


def _run_once(requests: list[Any]) -> list[Any]:
    """The answers to all sites of a formula that runs once."""
    formula, question, _, answer, args = requests[0]
    for i, (_, _, value, *_) in enumerate(requests):
        question.put(i, value)
    formula(*args)
    return [answer.at(i) for i in range(len(requests))]


def _added(values: list[Any]) -> Any:
    """The sum of values of one layout, number by number."""
    layout = carried_layout(values[0])
    columns = zip(*[leaves(value, layout) for value in values])
    return build(layout, iter([interleaved_sum(list(column)) for column in columns]))


_ANSWERS: dict[str, Callable[[list[Any]], Any]] = {
    "meet": lambda values: values, "total": _added, "repeated": _swept, "once": _run_once,
}  # fmt: skip
"""The answer to all sites, from the values that they ask with, by the word that they ask."""


def interleaved_sum(terms: list[float]) -> float:
    """The sum of numbers of all sites: sixteen sums, then by halves."""
    sums = [0.0] * TOGETHER
    for i, x in enumerate(terms):
        sums[i % TOGETHER] = sums[i % TOGETHER] + x
    return halves(sums)
