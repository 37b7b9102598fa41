"""Power series: numbers that know how they go on, so that a formula evaluated with them gives its
Taylor expansion.

    f(c_0 + c_1 s + c_2 s^2 + ...)

Coefficients are computed when they are asked for, each once, and may refer to earlier ones of the
same series.  So a series can be the solution of a differential equation: y' = f(y) gives
y_(k+1) = f(y)_k/(k + 1), and the formula f is run a single time.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 13 (Taylor arithmetic);
McIlroy, Squinting at power series, Software: Practice and Experience 20 (1990) (series that refer
to themselves).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from ...errors import InvalidType, NotCompilable
from .. import functions as f
from ..classes.layouts import build, layout_of, leaves
from ..classes.records import fields_of, fill
from ..classes.taken_back import noted
from ..vectors import Vec, vec
from .bases import INTEGER_POWER, ONLY_THERE, CarriesMore, InMemory, Operand, Pair, StandIn, raise_if, whole_power
from .dual import OVER, TIMES, Dual, rise_of_tanh
from .products import Products, cauchy, plus


def _termwise(combine: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """A sum or difference, of the terms of two series, or of the first one and a number."""

    def operator(self: Series, other: Any) -> Any:
        other = _as_series(other)
        if isinstance(other, Series):
            return _made(lambda k: combine(self.term(k), other.term(k)), self, other)
        if not _is_number(other):
            return NotImplemented
        if _is_none(other):
            return self
        return _made(lambda k: self.term(k) if k else combine(self.term(0), other), self)

    return operator


class Series(Operand):
    """c_0 + c_1 s + c_2 s^2 + ...  Comparisons look at c_0.

    A term that is not there, beyond the last of a polynomial or in sums of such, takes part in no
    operation.
    """

    __slots__ = ("_multiple", "_products", "_rank", "_rule", "_terms")

    def __init__(self, *terms: Any) -> None:
        self._terms: list[Any] = list(terms)  # None: there is no such term
        self._rule: Callable[[int], Any] | None = None
        self._rank = 0  # so many products of order k are made one after another for c_k
        self._products: Products | None = None  # among which those of this series are
        self._multiple: tuple[Any, Series] | None = None  # a number and the series it is times

    def term(self, k: int) -> Any:
        """c_k, a number; None if there is no such term."""
        if len(self._terms) <= k:
            if self._rule is None:
                return None
            while len(self._terms) <= k:
                self._terms.append(self._rule(len(self._terms)))
                noted(self._terms.pop)
        return self._terms[k]

    def __getitem__(self, k: int) -> Any:
        """The coefficient c_k, zero if there is no such term."""
        term = self.term(k)
        return 0.0 if term is None else term

    @property
    def head(self) -> Any:
        """The coefficient c_0, zero if there is no such term."""
        term = self.term(0)
        return 0.0 if term is None else term

    # -------------------------------------------------------------- arithmetic

    __add__ = __radd__ = _termwise(plus)
    __sub__ = _termwise(lambda a, b: _difference(a, b))

    def __rsub__(self, other: Any) -> Any:
        start = Series(other) if _is_number(other) else _as_series(other)
        return start - self if isinstance(start, Series) else NotImplemented

    def __mul__(self, other: Any) -> Any:
        other = _as_series(other)
        if isinstance(other, Series):
            return _multiplied(self, other)
        return _multiple(other, self) if _is_number(other) else NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        other = _as_series(other)
        if not isinstance(other, Series):
            return (
                _made(lambda k: _each(lambda c: c / other, self.term(k)), self) if _is_number(other) else NotImplemented
            )
        quotient, inverse = _undetermined(self, other), _inverse(other)
        quotient._rank += 1

        def rule(k: int) -> Any:  # a_k = sum_j b_j q_(k-j)
            if k == 0:
                return _each(lambda c: c / other.head, self.term(0))
            residual = _difference(self.term(k), cauchy(other, quotient, k, first=1))
            return _each(lambda c: c * inverse.head, residual)

        return quotient.by(rule)

    def __rtruediv__(self, other: Any) -> Any:
        start = Series(other) if _is_number(other) else _as_series(other)
        return start / self if isinstance(start, Series) else NotImplemented

    def __pow__(self, n: Any) -> Any:
        """Products for a whole exponent of few digits, so that a series may begin with zero."""
        if isinstance(n, (int, float)) and n == int(n) and abs(n) <= INTEGER_POWER:
            power = whole_power(self, abs(int(n))) if n else Series(1.0)
            return power if n >= 0 else 1.0 / power
        if isinstance(n, StandIn):
            raise NotCompilable("a power of a series whose exponent is known only at run time: write `exp(n * log(x))`")
        if isinstance(n, Series):
            return _integral(Series(self[0] ** n[0]), lambda power: power, n * f.log(self))
        if not _is_number(n):
            return NotImplemented
        return _power(Series(self[0] ** n), n, self)

    def __rpow__(self, base: Any) -> Any:
        if not _is_number(base):
            return NotImplemented
        return _integral(Series(base ** self[0]), lambda power: f.log(base) * power, self)

    def __mod__(self, other: Any) -> Any:
        """The remainder by a number: only the first term changes."""
        if isinstance(other, Series):
            return NotImplemented
        return _made(lambda k: self.term(k) if k else self[0] % other, self)

    def __floordiv__(self, other: Any) -> Any:
        """The quotient, rounded down, of the first term alone: it does not change along the series."""
        return NotImplemented if isinstance(other, Series) else self[0] // other

    def __neg__(self) -> Series:
        return _made(lambda k: _each(lambda c: -c, self.term(k)), self)

    def __pos__(self) -> Series:
        return self

    def __abs__(self) -> Series:
        head = self[0]
        return self * (1.0 * (head >= 0.0) - 1.0 * (head < 0.0))

    def __lt__(self, other: Any) -> Any:
        return self[0] < _head(other)

    def __le__(self, other: Any) -> Any:
        return self[0] <= _head(other)

    def __gt__(self, other: Any) -> Any:
        return self[0] > _head(other)

    def __ge__(self, other: Any) -> Any:
        return self[0] >= _head(other)

    def __eq__(self, other: object) -> Any:
        equal = self[0] == _head(other)
        self._not_only_here(equal, other)
        return equal

    def __ne__(self, other: object) -> Any:
        self._not_only_here(self[0] == _head(other), other)
        return self[0] != _head(other)

    def __bool__(self) -> bool:
        return bool(self != 0.0)

    def _not_only_here(self, equal: Any, other: Any) -> None:
        """Refuse that a series is equal to another number where it begins: it goes on."""
        if self is other:  # `x != x`, which asks for nan
            return
        if self._rule is not None or self._products is not None or len(self._terms) > 1:
            raise_if(equal, ONLY_THERE.format("a power series"))

    __hash__ = None  # type: ignore[assignment]

    def __float__(self) -> float:
        raise CarriesMore("a power series")

    def __repr__(self) -> str:
        return f"<power series {id(self):x}>"

    # -------------------------------------------------------------- what compiler and formulas ask
    # for

    def elementary(self, name: str, *x: Any) -> Series:
        """An elementary function of numbers of which some are series."""
        return _RULES[name](*x)

    @staticmethod
    def chosen(choose: Callable[[Any, Any], Any], yes: Any, no: Any) -> Series:
        """The series each of whose terms is chosen from two series."""
        a, b = (x if isinstance(x, Series) else Series(x) for x in (yes, no))
        return _made(lambda k: None if a.term(k) is None and b.term(k) is None else choose(a[k], b[k]), a, b)

    @staticmethod
    def unknown(start: Any, products: Products) -> Any:
        """A value whose numbers are unknown series that begin with those of `start`; `follow` determines them."""
        layout = layout_of(start)
        if layout.has_double_doubles:
            raise InvalidType(
                "precision: power series have numbers of one double; take precision='double' or another method"
            )
        return build(layout, iter([Series(x).among(products) for x in leaves(start, layout)]))

    @staticmethod
    def holding(x: Any) -> Series:
        """The series that holds a number; of a value and a slope that are series, that of numbers with slopes."""
        if isinstance(x, Series):
            return x
        return Series(_term_of(x, 0)).by(lambda k: _term_of(x, k)) if isinstance(x, Dual) else Series(x)

    @staticmethod
    def begun(x: Any, products: Products) -> Any:
        """An unknown that begins with a number; of one that carries a derivative each part is unknown."""
        if isinstance(x, Vec):
            return vec(*[Series.begun(part, products) for part in x])
        if not isinstance(x, Pair):
            return Series(1.0 * x).among(products)
        kind, *options = x.form
        return kind(*[Series.begun(part, products) for part in x.parts], *options)

    @staticmethod
    def follow(start: Any, unknown: Any, rates: Any, h: Any) -> None:
        """Let the unknown y solve y' = h rate, where the rates, a value like y, may depend on y."""
        layout = layout_of(start)
        for y, rate in zip(leaves(unknown, layout), leaves(rates, layout), strict=True):
            y.grow(rate, h)

    @staticmethod
    def unset(rates: Any, products: Products) -> Any:
        """Unknowns for a vector of rates, beginning with zero: series, or numbers that carry a
        derivative made of series, if one of the rates is.
        """
        pair = next((x for x in rates if isinstance(x, Pair)), None)
        return vec(*[_unset(pair, products) for _ in rates])

    @staticmethod
    def grown(unknown: Any, rate: Any, h: Any) -> None:
        """Let an unknown solve y' = h rate; of one that carries a derivative both its parts, and of its
        slopes along several directions each.
        """
        if isinstance(unknown, Vec):
            for i, series in enumerate(unknown):
                Series.grown(series, rate[i] if isinstance(rate, Vec) else rate, h)
            return
        if not isinstance(unknown, Pair):
            unknown.grow(rate, h)
            return
        of_one_form = isinstance(rate, Pair) and rate.form == unknown.form
        parts = rate.parts if of_one_form else (rate, 0.0)
        for series, part in zip(unknown.parts, parts, strict=True):
            Series.grown(series, part, h)

    @staticmethod
    def coefficient(x: Any, k: int) -> Any:
        """c_k of a value that is a series or made of them; numbers end with c_0."""
        if isinstance(x, tuple):
            parts = [Series.coefficient(part, k) for part in x]
            return vec(*parts) if isinstance(x, Vec) else tuple(parts)
        if not isinstance(x, Pair):
            return x[k] if isinstance(x, Series) else x if k == 0 else 0.0
        kind, *options = x.form
        return kind(*[Series.coefficient(part, k) for part in x.parts], *options)

    def grow(self, rate: Any, h: Any) -> None:
        """Let this unknown series y solve y' = h rate, where the rate may depend on y."""
        if isinstance(rate, Pair) and not isinstance(rate, Dual):
            raise InvalidType("a series can go on by numbers, also with slopes, and by series only")
        series = Series.holding(rate)
        if series._multiple:  # one factor for each term, which is known before the term is
            factor, series = series._multiple
            h = h * factor
        self.by(lambda k: _each(lambda c: h * (1.0 / k) * c, series.term(k - 1)))

    def grow_oddly(self, rate: Series, h: Any) -> None:
        """Let this unknown series y solve y' = h times the even part of the rate, so that y is odd."""
        self.by(lambda k: _each(lambda c: h * (1.0 / k) * c, rate.term(k - 1)) if k % 2 else None)

    def among(self, products: Products) -> Series:
        """The series itself, whose products, and those of series made of it, are then computed with these `products`."""
        self._products = products
        return self

    def by(self, rule: Callable[[int], Any]) -> Series:
        """The series itself, its further terms made by a rule; the first is computed at once."""
        self._rule = rule
        if not self._terms:
            self._terms.append(rule(0))
            noted(self._terms.pop)
        return self


def _term_of(x: Any, k: int) -> Any:
    """c_k of a number, of a series, of value + e slope of such, and of slopes along several directions."""
    if isinstance(x, Series):
        return x.term(k)
    if isinstance(x, Dual):
        slope = _each(lambda c: _infinitesimal(c if isinstance(c, tuple) else (c,), c, x.level), _term_of(x.slope, k))
        return plus(_term_of(x.value, k), slope)
    if isinstance(x, tuple):
        terms = [_term_of(c, k) for c in x]
        return None if all(c is None for c in terms) else vec(*[0 if c is None else c for c in terms])
    return None if k or _is_none(x) else x


def _is_none(x: Any) -> bool:
    """Whether a number is the integer 0, which takes part in no operation."""
    return type(x) is int and x == 0


def _infinitesimal(slopes: Any, like: Any, level: float) -> Any:
    """e times these slopes along several directions, or along one, as `like`: higher levels hold the e of this one."""
    if all(_is_none(x) for x in slopes):
        return 0
    highest = max([x.level for x in slopes if isinstance(x, Dual)], default=-1.0)
    if highest < level:
        return Dual(0, vec(*slopes) if isinstance(like, tuple) else slopes[0], level)
    held = [x if isinstance(x, Dual) and x.level == highest else Dual(x, 0, highest) for x in slopes]
    value = _infinitesimal([x.value for x in held], like, level)
    if highest == level:  # e^2 = 0
        return value
    width = next((len(x.slope) for x in held if isinstance(x.slope, tuple)), None)
    if width is None:
        return Dual(value, _infinitesimal([x.slope for x in held], like, level), highest)
    rows = [x.slope if isinstance(x.slope, tuple) else [0] * width for x in held]
    return Dual(value, vec(*[_infinitesimal(row, like, level) for row in zip(*rows)]), highest)


def _unset(pair: Any, products: Products) -> Any:
    """An unknown that begins with zero, of the kind of a number."""
    if isinstance(pair, Vec):
        return vec(*[_unset(part, products) for part in pair])
    if not isinstance(pair, Pair):
        return Series(None).among(products)
    kind, *options = pair.form
    return kind(*[_unset(part, products) for part in pair.parts], *options)


def _made(rule: Callable[[int], Any], *of: Series) -> Series:
    return _undetermined(*of).by(rule)


def _undetermined(*of: Series) -> Series:
    """A series of which the term k is made of the terms k of others, by sums."""
    series = Series() if all(type(x) is Series for x in of) else SeriesInMemory()
    series._rank = max(x._rank for x in of)
    series._products = next((x._products for x in of if x._products), None)
    return series


def _multiple(factor: Any, of: Series) -> Series:
    multiple = _made(lambda k: _each(lambda c: factor * c, of.term(k)), of)
    within, base = of._multiple or (None, of)
    multiple._multiple = factor if within is None else factor * within, base
    return multiple


def _multiplied(a: Series, b: Series) -> Series:
    product = _undetermined(a, b)
    product._rank += 1
    if product._products is None:
        return product.by(lambda k: cauchy(a, b, k))
    return product.by(product._products.joined(a, b, product._rank))


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float, StandIn))


def _head(x: Any) -> Any:
    return x[0] if isinstance(x, Series) else x


def _difference(a: Any, b: Any) -> Any:
    return a if b is None else -b if a is None else a - b


def _each(function: Callable[[Any], Any], c: Any) -> Any:
    return None if c is None else function(c)


class _Rule:
    """Terms by a rule, for a sum of products."""

    def __init__(self, term: Callable[[int], Any]) -> None:
        self.term = term


def _inverse(x: Series) -> Series:
    """1/x_0, computed when a first term needs it."""
    inverse = Series()
    inverse._rule = lambda k: 1.0 / x.head
    return inverse


# ------------------------------------------------------------------ of what lies in memory


class SeriesInMemory(Series, InMemory):
    """A series with vectors or matrices in memory as terms, or series of them in their turn: `+ - * /`
    number by number, with numbers and series of numbers too, `@` of matrices.
    """

    __slots__ = ()

    @staticmethod
    def at(state: Any) -> Any:
        """A state of series that begin with the vectors and matrices of another one."""
        fields = fields_of(state).items()
        return fill(type(state), {k: x if x is None else SeriesInMemory(x) for k, x in fields})

    @staticmethod
    def continued(unknown: Any, rates: Any, h: Any) -> None:
        """Let the unknowns of a state solve y' = h rate, where the rates, a value like y, may depend on y."""
        for y, rate in zip(fields_of(unknown).values(), fields_of(rates).values(), strict=True):
            if y is not None:
                y.grow(rate, h)

    def __iter__(self) -> Any:
        raise InvalidType("a power series of a vector in memory has no components to go through")

    @property
    def _one(self) -> Any:
        """The first term that there is, for its shape."""
        k = 0
        while self.term(k) is None:
            k += 1
        return self.term(k)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape that each of its terms has."""
        return self._one.shape

    @property
    def axes(self) -> int:  # type: ignore[override]
        return len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def coefficient_of(self, k: int) -> Any:
        """c_k, zeros where there is no such term."""
        term = self.term(k)
        return 0.0 * self._one if term is None else term

    def each(self, linear: Callable[[Any], Any]) -> SeriesInMemory:
        return cast(SeriesInMemory, _made(lambda k: _each(linear, self.term(k)), self))

    def __getitem__(self, index: Any) -> Any:
        """The series of an entry."""
        return Series().by(lambda k: _each(lambda c: c[index], self.term(k)))

    def __matmul__(self, other: Any) -> Any:
        return _convolved(self, _as_series(other), lambda a, b: a @ b, SeriesInMemory())

    def __rmatmul__(self, other: Any) -> Any:
        return _as_series(other) @ self

    def inner_with(self, other: Any) -> Any:
        return _convolved(self, _as_series(other), lambda a, b: a.inner_with(b), Series())

    @property
    def T(self) -> SeriesInMemory:
        """The transpose A^T, term by term."""
        return self.each(lambda c: c.T)

    @property
    def H(self) -> SeriesInMemory:
        """The conjugate transpose A^H, term by term."""
        return self.each(lambda c: c.H)

    def without_adjoint(self) -> SeriesInMemory:
        """The difference A - A^H, term by term."""
        return self.each(lambda c: c.without_adjoint())

    def plus(self, s: float) -> SeriesInMemory:
        """The sum A + s 1: only the first term changes."""
        shifted: Any = SeriesInMemory(self.coefficient_of(0).plus(s))
        return cast(SeriesInMemory, shifted.by(self.term))


def _as_series(x: Any) -> Any:
    """Vectors and matrices in memory as series that end with their first term."""
    return SeriesInMemory(x) if isinstance(x, InMemory) and not isinstance(x, Series) else x


def _convolved(a: Series, b: Series, product: Callable[[Any, Any], Any], series: Series) -> Any:
    """sum_j a_j b_(k-j) of a product that does not commute."""

    def rule(k: int) -> Any:
        total = None
        for j in range(k + 1):
            x, y = a.term(j), b.term(k - j)
            total = total if x is None or y is None else plus(total, product(x, y))
        return total

    return series.by(rule)


# ------------------------------------------------------------------ elementary functions:
# f(x)' = f'(x) x'


def _integral(y: Series, slope: Callable[[Series], Any], x: Series) -> Series:
    """y, given its first term, with y' = slope(y) x'."""
    y._rank, y._products = x._rank + 1, x._products
    steepness, weighted = slope(y), Series()
    g = steepness if isinstance(steepness, Series) else Series(steepness)
    # s x', no term before its time
    weighted._rule = lambda k: _each(lambda c: float(k) * c, x.term(k) if k else None)
    return y.by(lambda k: _each(lambda c: c * (1.0 / k), cauchy(weighted, g, k)))


def _divided(y: Series, x: Series, d: Series, residual: Callable[[int], Any]) -> Series:
    """y, a function of x, given its first term, with d_0 y_k = rest(k)."""
    y._rank, y._products = x._rank + 1, x._products
    inverse = _inverse(d)
    return y.by(lambda k: _each(lambda c: c * inverse[0], residual(k)))


def _power(y: Series, n: Any, x: Series) -> Series:
    """y = x^n, given its first term: x y' = n x' y.

    x_0 y_k = sum_j (n j/k - (k-j)/k) x_j y_(k-j),  j > 0
    """

    def rest(k: int) -> Any:
        weighted = _Rule(lambda j: _each(lambda c: ((n * j - (k - j)) / k) * c, x.term(j)))
        return cauchy(weighted, y, k, first=1)

    return _divided(y, x, x, rest)


def _sqrt(x: Series) -> Series:
    """The root y of y^2 = x."""
    y = Series(f.sqrt(x[0]))

    def residual(k: int) -> Any:
        middle = _Rule(lambda j: y.term(j) if 0 < j < k else None)
        return _difference(x.term(k), cauchy(middle, middle, k))

    return _divided(y, x, 2.0 * y, residual)


def _rule(function: Callable[..., Any], slope: Callable[[Series, Series], Any]) -> Callable[[Series], Series]:
    """An elementary function of a series x: y = f(x), from f' as a function of x and y."""
    return lambda x: _integral(Series(function(x[0])), lambda y: slope(x, y), x)


def _over(function: Callable[..., Any], steepness: Callable[[Series, None], Series]) -> Callable[[Series], Series]:
    """The series of the inverse from d = 1/f' as a function of x alone, in one sum of products.

    d y' = x':   d_0 y_k = x_k - sum_j (j/k) y_j d_(k-j),   0 < j < k
    """

    def series_of(x: Series) -> Series:
        y, d = Series(function(x[0])), steepness(x, None)

        def residual(k: int) -> Any:
            middle = _Rule(lambda j: _each(lambda c: (j / k) * c, y.term(j) if 0 < j < k else None))
            return _difference(x.term(k), cauchy(middle, d, k))

        return _divided(y, x, d, residual)

    return series_of


def _circle(
    cosine: Callable[[Any], Any], sine: Callable[[Any], Any], sign: float, which: int
) -> Callable[[Series], Series]:
    """cos and sin, or cosh and sinh: c' = sign s x', s' = c x'."""

    def rule(x: Series) -> Series:
        c, s = Series(cosine(x[0])), Series(sine(x[0]))
        return (_integral(c, lambda c: sign * s, x), _integral(s, lambda s: c, x))[which]

    return rule


def _tanh(x: Series) -> Series:
    """tanh by its derivative s: y' = s x', s' = -2 y s x'."""
    y = Series(f.tanh(x[0]))
    s = Series(rise_of_tanh(x[0], y[0]))
    _integral(s, lambda s: -2.0 * y * s, x)
    return _integral(y, lambda _: s, x)


def _atan2(y: Any, x: Any) -> Series:
    """The angle a of (x, y): a' = (x y' - y x')/(x^2 + y^2)."""
    y, x = (a if isinstance(a, Series) else Series(a) for a in (y, x))
    square = x * x + y * y
    rise, fall = (_integral(Series(None), lambda _: x / square, y), _integral(Series(None), lambda _: y / square, x))
    return Series(f.atan2(y[0], x[0])) + (rise - fall)


def _copysign(x: Any, y: Any) -> Any:
    """x or -x, whichever has the sign of y where the series begin."""
    return x * (f.copysign(1.0, _head(x)) * f.copysign(1.0, _head(y)))


_RULES: dict[str, Callable[..., Any]] = {
    **{name: _rule(getattr(f, name), TIMES[name]) for name in ("exp", "exp2", "tan")},
    **{name: _over(getattr(f, name), OVER[name]) for name in OVER.keys() - {"sqrt", "cbrt"}},
    "sqrt": _sqrt,
    "cbrt": lambda x: _power(Series(f.cbrt(x[0])), 1.0 / 3.0, x),
    "expm1": lambda x: Series(f.expm1(x[0])).by(f.exp(x).term),
    "tanh": _tanh,
    "cos": _circle(f.cos, f.sin, -1.0, 0),
    "sin": _circle(f.cos, f.sin, -1.0, 1),
    "cosh": _circle(f.cosh, f.sinh, 1.0, 0),
    "sinh": _circle(f.cosh, f.sinh, 1.0, 1),
    "atan2": _atan2,
    "copysign": _copysign,
    "pow": lambda x, n: x**n,
}
