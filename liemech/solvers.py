"""The one Newton iteration and the one fixed point iteration: when they stop, and what they say
when they do not converge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .errors import NoConvergence
from .formulas import Mat, Record, Vec, cross, dot, jacobian, mat, record, solve, solve3, sqrt, sum, vec, where
from .formulas.classes.layouts import layout_of
from .formulas.numbers.conversions import double_double, moving_as, rounded
from .formulas.numbers.double_double import is_long
from .formulas.numbers.dual import Dual, constant, size_of_slope, value_of
from .formulas.numbers.sizes import EPSILON, one_norm
from .formulas.numbers.transposes import Residual, determined, is_pulled, quiet
from .formulas.sites import repeated, total
from .formulas.vectors import Vec as SmallVec

TOLERANCE = 2.0**-30
"""A residual below this, relative to the data, means that the correction it asks for is the last
one needed.

Newton's method squares the relative error, so one more correction leaves about 2^-60: below
rounding, and without the energy drift that stopping *at* a tolerance causes.
"""

NOISE = 2.0**-40
"""A change that does not become smaller is rounding, if it is below this, relative to the data;
else it is no convergence.

Rounding of the largest of the data may be large beside the smallest one.
"""

STALLED = 5
"""After this many sweeps without a smaller change, what still changes in one unit is the rounding of
what cancelled there.
"""

LIMIT = 50
"""Iterations after which a step is declared unsolvable; a good step needs two or three."""

SWEEPS = 100
"""Sweeps over all sites after which a step is declared unsolvable: each gains as much as the last."""


def newton(
    equation: Callable[[Vec], tuple[Vec, Mat, float]],
    guess: Vec,
    data: float | Vec = 1.0,
    rate: float = 1.0,
    tolerance: float = TOLERANCE,
    solved: Callable[[Mat, Vec], Vec] | None = None,
    weights: Vec | None = None,
    coupled: bool = False,
) -> tuple[Vec, float, float, bool]:
    """The root of an equation: its residual is tested against the data, and the correction that it
    asks for applied once more.

    equation : gives at x the residual r, its derivative and the factor w that |r|^2 has over the
    data.  data : the vector that r is beside, or its square; one where residuals are numbers without a unit.
    tolerance : smaller for a derivative that is not exact, with which the last correction gains
    fewer digits.
    solved : the solution of a linear system, if `correction` is not the best way to it.
    weights : of the residuals where they are tested; None: all are one.
    coupled : is it the equation of one of many sites, which asks the others?  Then all are `swept`.
    In numbers of two doubles it is found to 16 digits first, and then `refined`, by a derivative
    that is not exact `iterated`.
    Returns x, |r|^2 at the last test, in the `unit_of` the data, what it had to reach (w tolerance^2 data, else x is no root),
    and whether x is `beyond_fold`.
    """
    if is_pulled():
        bare = lambda y: quiet(equation, y)  # noqa: E731
        x, size, enough, folded = quiet(newton, bare, guess, data, rate, tolerance, solved, weights, coupled)
        of = Residual(equation, x)
        return determined(of, root_back, of, of.others[0], coupled), size, enough, folded
    unit = 1.0
    if isinstance(data, SmallVec):
        unit = unit_of(data)
        data = dot(unit * data, unit * data)
    if coupled:
        return swept(equation, guess, data, solved, unit)
    x, goal = guess, tolerance * tolerance * data
    long = is_long(guess[0])
    if long:
        x, goal = rounded(guess), rounded(goal)
    size = enough = goal
    folded = False
    for _ in range(LIMIT):
        r, jacobian, weight = equation(x)
        if long:
            r, jacobian, weight = rounded((r, jacobian, weight))
        x = x - _asked(solved, jacobian, r)
        folded = beyond_fold(jacobian, rate)
        tested = unit * r if weights is None else narrow(weights) * r
        size, enough = dot(tested, tested), weight * goal
        if size <= enough:
            break
    if long:
        x = (
            refined(equation, x, solved)
            if tolerance >= TOLERANCE
            else iterated(equation, x, EPSILON * EPSILON * goal, solved)
        )
    return x, size, enough, folded


def root_back(of: Any, jacobian: Mat, coupled: bool, w: Vec) -> Vec:
    """-(dr/dx)^-T w, of a root of r(x) = 0: the derivative by r of what has the derivative w by the root.

    jacobian : dr/dx; of one of many coupled sites its own block, by which all are swept.
    """

    def sweep(nu: Vec) -> tuple[Vec, float, float]:
        change = correction(jacobian.T, w - of.felt(nu))
        return nu + change, sqrt(dot(change, change)), sqrt(dot(nu, nu))

    first = correction(jacobian.T, w)
    return -fixed_point(sweep, first, "the way back through a root", 1.0) if coupled else -first


def unit_of(x: Vec) -> float:
    """A power of two that brings a vector near one, so that its square is neither zero nor infinite."""
    size = SMALLEST
    for component in x:
        size = size + abs(value_of(component))
    return 1.0 / leading_power(min(size, 1.0 / SMALLEST))


def leading_power(x: float) -> float:
    """The power of two in |x|, 2^floor(log2 |x|), by rounding alone.

    Source: Rump, Ogita, Oishi, Accurate floating-point summation I, SIAM J. Sci. Comput. 31 (2008),
    189, algorithm 3.5.
    """
    q = (2.0**52 + 1.0) * x
    return abs(q - (1.0 - 2.0**-53) * q)


SMALLEST = 2.0**-900
"""Units of vectors beyond this, or its inverse, are not looked for."""

FORESEEN = 2.0**-10
"""A bend that a correction has foreseen up to this part of it leaves Newton's method as it is."""

CUT = 12
"""Corrections of rates and kicks after which they end where an energy is least: those that go round in a circle."""


def newton_of_kicks(
    kicks: Callable[[Vec], Vec], led_to: Callable[[Vec], tuple[Vec, float]], guess: Vec
) -> tuple[Vec, float, float]:
    """The rates w = A(k(w)) to which kicks lead that depend on them, each on its own rate, k_i(w_i):
    Newton's method, with `slope_beside` for those that bend sharply, as dry friction does.  Kicks that fall with their
    rates are the stationarity of a convex energy, (v - v0) . J (v - v0)/2 - sum of the integrals of k_i; with
    w = A(u) a correction (dw, du) has along it the slope dw . (u + s du - k(w + s dw)), and is cut, after `CUT` of
    them, where that vanishes.

    kicks : k.  led_to : A, affine, and the square that residuals are relative to.
    Returns w, |r|^2 at the last test and what it had to reach, as `newton`.

    Source: Nocedal and Wright, Numerical Optimization, 2nd ed. (2006), section 3.3 (line searches for Newton's method).
    """
    w, foreseen = guess, kicks(guess)
    before, step, drawn = foreseen, 0.0 * guess, 0.0 * guess
    idle, by_kick = kicks(0.0 * guess), jacobian(lambda k: led_to(k)[0], foreseen)
    size = enough = dot(guess, guess)

    def slope(part: float, w: Vec, step: Vec, drawn: Vec, more: Vec) -> float:
        return dot(step, drawn + part * more - kicks(w + part * step))

    for tried in range(LIMIT):
        k, tangent = kicks(w), jacobian(kicks, w)
        slopes = [
            slope_beside(k[i], idle[i], before[i], foreseen[i], w[i], step[i], tangent[i, i]) for i in range(len(w))
        ]
        rates, scale = led_to(k)
        r, size, enough = w - rates, dot(w - rates, w - rates), TOLERANCE * TOLERANCE * scale
        rows = [
            vec(*[(1.0 if i == j else 0.0) - by_kick[i, j] * slopes[j] for j in range(len(w))]) for i in range(len(w))
        ]
        before, step = k, -correction(mat(*rows), r)
        foreseen = vec(*[k[i] + slopes[i] * step[i] for i in range(len(w))])
        if tried >= CUT and size > enough:
            part = least_part(slope, dot(step, foreseen - drawn), w, step, drawn, foreseen - drawn)
            step, foreseen = part * step, drawn + part * (foreseen - drawn)
        w, drawn = w + step, foreseen
        if size <= enough:
            break
    return w, size, enough


def least_part(slope: Callable[..., float], scale: float, *beside: Vec) -> float:
    """The part of a step, to a sixteenth, at which an energy is least that has this slope along it; 1 where it falls
    all the way, up to little beside `scale`, or nowhere.  beside : arguments of the slope after the part.
    """
    low, high, part = 0.0, 1.0, 1.0
    for _ in range(LIMIT):
        if slope(part, *beside) > FORESEEN * abs(scale):
            high = part
        else:
            low = part
        if high - low <= 0.0625 * low:
            break
        part = 0.5 * (low + high)
    return where(low > 0.0, low, 1.0)


def slope_beside(
    kick: float, idle: float, before: float, foreseen: float, rate: float, step: float, tangent: float
) -> float:
    """The slope with which Newton's method goes on from a kick k(w) that bends sharply: one between the tangent
    and a secant,

        s + rho (k' - s),   s = (k - k(0))/w,   rho = (u - k(0))/(k - k(0)) in [-1, 1]

    u : the kick that the last correction foresaw.  Where it was right, rho = 1, this is Newton's
    method; where the rate has jumped over the bend it is the slope of a chord, which does not jump
    back.  The secant is that from rest, about which dry friction bends, or the one from the kick before the last
    step, whichever is steeper: a motor bends about its highest speed.
    Residuals of dry friction vanish in less than two dozen corrections, whatever its speed.

    Source: Chan, Golub and Mulet, SIAM J. Sci. Comput. 20 (1999), 1964 (with the dual unknown
    eliminated).
    """
    steeper = abs(kick - before) * abs(rate) > abs(kick - idle) * abs(step)
    begin, run = where(steeper, before, idle), where(steeper, step, rate)
    bend, deviation = kick - begin, abs(foreseen - kick)
    noise = NOISE * (abs(kick) + abs(begin))
    off_by_little = deviation <= FORESEEN * max(abs(kick - idle), abs(bend)) + noise
    right = off_by_little | (abs(bend) <= noise) | (constant(run) == 0.0)
    secant = bend / where(right, 1.0, run)
    rho = max(-1.0, min(1.0, (foreseen - begin) / where(right, 1.0, bend)))
    return where(right, tangent, secant + rho * (tangent - secant))


def swept(
    equation: Callable[[Vec], tuple[Vec, Mat, float]],
    guess: Vec,
    data: float,
    solved: Callable[[Mat, Vec], Vec] | None = None,
    unit: float = 1.0,
) -> tuple[Vec, float, float, bool]:
    """The roots of the equations of all sites: again and again each takes the correction that its
    own derivative asks for, with the others where they are, until the residuals do no more than
    rounding does; and then on, until the derivatives that they carry do no more either.

    The arguments and results are those of `newton`; residuals are relative to the data of each
    site, both in its unit, and the mean of their squares over all sites is tested.
    """

    count = total(1.0)

    def sweep(x: Vec) -> tuple[Vec, float]:
        r, jacobian, weight = equation(x)
        scale = weight * data
        beside = unit * r
        change2 = where(scale > 0.0, dot(beside, beside) / where(scale > 0.0, scale, 1.0), 0.0)
        return x - _asked(solved, jacobian, r), value_of(change2)

    def judge(before: Settling, change2: float) -> tuple[Settling, bool]:
        settling = before.after(sqrt(change2 / count), 1.0, EPSILON, NOISE)
        return settling, settling.done or not settling.change < math.inf

    def sweep_of_slopes(x: Vec) -> tuple[Vec, tuple[float, float]]:
        r, jacobian, _ = equation(x)
        slopes = vec(*[y - value_of(y) for y in _asked(solved, jacobian, r)])
        change, scale = 0.0, 0.0
        for k in range(len(x)):
            change, scale = change + size_of_slope(slopes[k]), scale + size_of_slope(x[k])
        return x - slopes, (change, scale)

    def judge_slopes(before: Settling, told: tuple[float, float]) -> tuple[Settling, bool]:
        settling = before.after(told[0], told[1], EPSILON, NOISE)
        return settling, settling.done or not settling.change < math.inf

    x, end = repeated(sweep, moving_as(guess, data), judge, Settling(), SWEEPS)
    size = end.change * end.change
    enough = where(end.done, size, 4096.0 * EPSILON * EPSILON)
    if isinstance(x[0], Dual):  # derivatives settle later than values, which stay
        x, of_slopes = repeated(sweep_of_slopes, x, judge_slopes, Settling(), SWEEPS)
        size = where(of_slopes.done, size, math.inf)
    return x, size, enough, False


def refined(
    equation: Callable[[Vec], tuple[Vec, Mat, float]], x: Vec, solved: Callable[[Mat, Vec], Vec] | None = None
) -> Vec:
    """A root that is known to 16 digits, in numbers of two doubles: 31 digits of the residual, 16
    of its derivative.

    equation, solved : as for `newton`.
    """
    _, jacobian, _ = equation(x)
    x = double_double(x)
    r, _, _ = equation(x)
    return x - _asked(solved, rounded(jacobian), rounded(r))


def iterated(
    equation: Callable[[Vec], tuple[Vec, Mat, float]],
    x: Vec,
    goal: float,
    solved: Callable[[Mat, Vec], Vec] | None = None,
) -> Vec:
    """A solution by a derivative that is not exact, with which each correction gains a few digits
    only.

    goal : what w^-1 |r|^2 has to reach before the last correction; the others are as for `newton`.
    """
    jacobian = rounded(equation(x)[1])
    x = double_double(x)
    for _ in range(LIMIT):
        at = rounded(equation(x))
        x = x - _asked(solved, jacobian, at[0])
        if dot(at[0], at[0]) <= at[2] * goal:
            break
    return x


def narrow(x: Vec) -> Vec:
    """A vector in numbers of one double."""
    return rounded(x) if is_long(x[0]) else x


def _asked(solved: Callable[[Mat, Vec], Vec] | None, jacobian: Mat, r: Vec) -> Vec:
    """The correction that a residual asks for."""
    return correction(jacobian, r) if solved is None else solved(jacobian, r)


def fixed_point(sweep: Callable[[Any], tuple[Any, float | Vec, float | Vec]], guess: Any, method: Any, h: float) -> Any:
    """A fixed point of sweeps: they are repeated until they change no more than rounding does.

    sweep : gives of an unknown a better one, how much they differ and how large the data are; for
    data in several units both of each, which are compared apart and added up relative to their
    size.
    It ends when a change is below eps, when the next one, judged by the last two, of which none is as large as the
    data, would be below eps/16, or when the changes are rounding and become no smaller; where the data of one unit
    cancel and leave rounding alone, that is rounding beside all of them.  Raises NoConvergence in
    the name of a method with step size h.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.6.2 and VIII.5
    (the error is iterated away).
    """
    if is_pulled():
        unknown = quiet(fixed_point, lambda x: quiet(sweep, x), guess, method, h)
        of = Residual(sweep, unknown)
        return determined(of, fixed_back, of, method, h)
    words = 2 if layout_of(guess).has_double_doubles else 1
    epsilon, noise = EPSILON**words, NOISE**words

    def told(unknown: Any) -> Any:
        new, changes, sizes = sweep(unknown)
        return new, rounded((changes, sizes)) if words == 2 else (changes, sizes)

    def judge(before: Settling, told: Any) -> Any:
        settling = before.after(told[0], told[1], epsilon, noise)
        # iterates that grow without bound: no change is small beside infinity
        return settling, settling.done or not settling.size < math.inf

    unknown, end = repeated(told, guess, judge, Settling(), words * LIMIT)
    change, size, done = end.change, end.size, end.done
    if not done:  # what is rounding in one unit may be small beside all data
        change, size = end.all_change, end.all_size
    rounding = where(end.since >= STALLED, noise, 64.0 * epsilon)  # which may be large, as of forces that cancel
    if not (size < math.inf and (done or change <= rounding * size)):
        divergence = ": they left the domain of a formula, or grew without bound"
        raise NoConvergence(
            f"{method!r}: the stages did not converge"
            f"{f' in {LIMIT} iterations, they still change by {change / size:.1e}' if size < math.inf else divergence}. "
            f"The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
        )
    return unknown


def fixed_back(of: Any, method: Any, h: float, w: Vec) -> Vec:
    """nu = w + (dS/dx)^T nu, of a fixed point x = S(x): the derivative by S of what has the derivative w by it."""

    def sweep(nu: Vec) -> tuple[Vec, float, float]:
        new = w + of.felt(nu)
        return new, sqrt(dot(new - nu, new - nu)), sqrt(dot(new, new))

    return fixed_point(sweep, w, method, h)


@record
class Settling(Record):
    """The convergence of sweeps: the last change and the size that it is relative to, in each unit and of all units
    together; the least change so far, and the number of sweeps since.

    done : do they change no more than rounding does?
    """

    change: float = 0.0
    size: float = 0.0
    all_change: float = 0.0
    all_size: float = 0.0
    least: float = math.inf
    since: float = 0.0
    done: bool = False

    def after(self, changes: Any, sizes: Any, epsilon: float, noise: float) -> Settling:
        """The record after one more sweep of these changes."""
        before, least, since = self.change, self.least, self.since
        change, size = _in_one_unit(changes, sizes)
        all_change, all_size = _added_up(changes), _added_up(sizes)
        done = change <= epsilon * size
        if before > 0.0:
            ratio = change / before
            # a change as large as the data foretells nothing
            foreseen = before < self.size and 16.0 * ratio * change <= epsilon * size
            done = done or foreseen or (ratio >= 1.0 and change <= noise * size)
        if _is_in_units(changes):
            since = where(change < least, 0.0, since + 1.0)
            least = where(change < least, change, least)
            done = done or (since >= STALLED and all_change <= 64.0 * epsilon * all_size)
        return Settling(change, size, all_change, all_size, least, since, done)


def _in_one_unit(change: Any, size: Any) -> tuple[float, float]:
    """A change and what it is relative to; of several units the sum of the relative changes, and 1."""
    if not _is_in_units(change):
        return _added_up(change), _added_up(size)
    total = 0.0
    for c, s in zip(change, size):
        total = total + where(s > 0.0, c / where(s > 0.0, s, 1.0), where(c > 0.0, 1.0, 0.0))
    return total, where(_added_up(size) < math.inf, 1.0, math.inf)


def _is_in_units(change: Any) -> bool:
    """Whether the change is a vector, one number for each unit."""
    return isinstance(change, SmallVec) and len(change) > 1


def _added_up(x: Any) -> float:
    """The sum of the components of a vector, or a number as it is."""
    return sum(x) if isinstance(x, SmallVec) else x


def correction(jacobian: Mat, residual: Vec) -> Vec:
    """The correction that Newton's method subtracts: jacobian^-1 residual.  jacobian : (n, n), residual : (n,)."""
    if len(residual) == 2:
        return solve2(jacobian, residual)
    if len(residual) == 3:
        return solve3(jacobian, residual)
    return solve6(jacobian, residual) if len(residual) == 6 else solve(jacobian, residual)


def solve2(m: Mat, rhs: Vec) -> Vec:
    """The solution of a 2 by 2 system by Cramer's rule: no branch, one division."""
    scale = 1.0 / (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0])
    return vec(scale * (m[1, 1] * rhs[0] - m[0, 1] * rhs[1]), scale * (m[0, 0] * rhs[1] - m[1, 0] * rhs[0]))


def solve6(m: Mat, rhs: Vec) -> Vec:
    """The solution of a 6 by 6 system by its 3 by 3 blocks: no branch, two divisions.

    With m = [[A, B], [C, D]] and rhs = (e, f):  (A - B D^-1 C) x = e - B D^-1 f,  D y = f - C x.  D must be regular, as it is in a
    Newton step, where m is close to a positive inertia over h.
    """
    A, B = _block(m, 0, 0), _block(m, 0, 3)
    C, D = _block(m, 3, 0), _block(m, 3, 3)
    last = vec(rhs[3], rhs[4], rhs[5])
    if one_norm(vec(D[0, 1], D[0, 2], D[1, 0], D[1, 2], D[2, 0], D[2, 1])) == 0.0:
        d = vec(1.0 / D[0, 0], 1.0 / D[1, 1], 1.0 / D[2, 2])  # an inertia, along its axes
        G, g = mat(*[d[i] * C[i] for i in range(3)]), d * last
    else:
        a, b, c = D.T
        bc = cross(b, c)
        inverse = (1.0 / dot(a, bc)) * mat(bc, cross(c, a), cross(a, b))
        G, g = inverse @ C, inverse @ last
    x = solve3(A - B @ G, vec(rhs[0], rhs[1], rhs[2]) - B @ g)
    y = g - G @ x
    return vec(*x, *y)


def _block(m: Mat, i: int, j: int) -> Mat:
    return mat(*[vec(m[k, j], m[k, j + 1], m[k, j + 2]) for k in range(i, i + 3)])


def beyond_fold(jacobian: Mat, rate: float) -> bool:
    """Whether the determinant has the sign that it cannot have on the branch from h = 0; False in other
    dimensions than three.

    jacobian : (n, n), there rate times a positive matrix.
    """
    if len(jacobian) != 3:
        return False
    a, b, c = jacobian.T
    return rate * dot(a, cross(b, c)) <= 0.0
