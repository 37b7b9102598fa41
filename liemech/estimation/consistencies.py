"""Is a filter as uncertain as it says?  Squared errors of many runs against chi-square."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import real_array, shown
from ..formulas.classes.frozen import frozen


@frozen(eq=False)
class Consistency:
    """Averages of squared errors over runs, (times,), and the bounds between which the average of a consistent filter
    lies with the given probability, at each time.
    """

    average: np.ndarray
    bounds: tuple[float, float]
    probability: float

    @property
    def mean(self) -> float:
        """The average over all runs and times, which is dim for a consistent filter."""
        return float(self.average.mean())

    @property
    def inside(self) -> float:
        """The share of times within the bounds."""
        low, high = self.bounds
        return float(np.mean((low <= self.average) & (self.average <= high)))

    def __str__(self) -> str:
        low, high = self.bounds
        return (
            f"squared error {self.mean:.3f} on average, {100 * self.inside:.1f} % of times within "
            f"[{low:.3f}, {high:.3f}] ({100 * self.probability:g} % expected)"
        )


def consistency(nees: Any, dim: Any, probability: float = 0.95) -> Consistency:
    """Squared errors e . P^-1 e of many runs against chi-square: their average over m runs, times m, has
    the distribution of chi-square with m dim degrees of freedom.

    nees : (times, runs), as `Belief.nees` gives; or squared innovations (`Belief.nis`).
    dim : degrees of freedom of one.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001),
    section 5.4.2.
    """
    from scipy.special import gammaincinv

    squares = real_array(nees, "consistency: nees")
    if squares.ndim != 2 or not squares.size:
        raise InvalidInput(f"consistency: nees has shape {squares.shape}; it must be (times, runs)")
    if not (squares >= 0.0).all():
        raise InvalidInput(f"consistency: nees holds squares, which are not negative; got {shown(squares)}")
    if not isinstance(dim, (int, np.integer)) or dim < 1:
        raise InvalidInput(f"consistency: dim is the number of components of an error, 1 or more; got {dim!r}")
    if not 0.0 < probability < 1.0:
        raise InvalidInput(f"consistency: probability is between 0 and 1; got {probability!r}")
    runs, tail = squares.shape[1], 0.5 * (1.0 - probability)
    low, high = (2.0 * gammaincinv(0.5 * runs * dim, p) / runs for p in (tail, 1.0 - tail))
    return Consistency(squares.mean(axis=1), (float(low), float(high)), probability)
