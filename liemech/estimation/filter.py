"""The base of all filters on a group: beliefs are predicted by a process and updated by sensors."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InvalidInput, require, undefined
from ..formulas import Ambient, Element, Mat, Record, Vec, record
from ..formulas.arrays import real_array
from .belief import Belief, checked, is_vouched, vouched
from .errors_of_elements import check_side
from .processes import Process
from .sensors import Sensor, require_elements

EVERYTHING = 1e300
"""The limit of the squared innovation where there is no gate."""


@record
class OfBeliefs(Record):
    """Formulas of an element and the covariance of its error, on the group of a process or a sensor; abstract."""

    @property
    def group(self) -> Any:
        """The group of the process, or of the sensor."""
        return self._space.group

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.group.dim, self.group.dim) if argument == "covariance" else super()._shape(argument, kind)

    def _complex(self, kind: str) -> bool:
        return kind != "Mat" and super()._complex(kind)  # matrices are covariances


@record
class Correction(OfBeliefs):
    """How a measurement of one sensor corrects a belief; abstract.

    limit : of the squared innovation; beyond it the belief stays.

    Source: Sarkka, Bayesian Filtering and Smoothing, 2nd ed., section 5.2.
    """

    sensor: Any
    side: str
    reset: bool
    limit: float

    def corrected(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Any, Any, float]:
        """The element, its covariance, and r . S^-1 r."""
        raise undefined(self, "corrected")

    def innovation(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Any, Any]:
        """The innovation r and its covariance S."""
        raise undefined(self, "innovation")

    _space = property(lambda self: self.sensor)


@record
class Filter(OfBeliefs):
    """A filter on the group of a process; abstract.

    side : of the error, "left": x = g exp(e), or "right": x = exp(e) g.
    reset : is the covariance carried to the new estimate by dexp after an update?  A correction of
        second order, which the filters in print leave out.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017).
    """

    process: Process
    side: str = "left"
    reset: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_side(type(self).__name__, self.side)
        require(f"{type(self).__name__}: process", self.process, Process)

    @cached_property
    def _corrections(self) -> dict[Any, Correction]:
        """The corrections by sensors that it has seen."""
        return {}

    # ---------------------------------------------------------------- a subclass writes

    def propagated(self, g: Element, covariance: Mat, u: Vec, h: float) -> tuple[Any, Any]:
        """The element after a step, and its covariance."""
        raise undefined(self, "propagated")

    def correction(self, sensor: Any, limit: float) -> Correction:
        """The correction by a sensor, which a subclass defines."""
        raise undefined(self, "correction")

    # ---------------------------------------------------------------- what follows

    def belief(self, g: Any, covariance: Any) -> Belief:
        """A start: an element and the covariance of its error on the side of this filter.

        covariance : (dim, dim), or (dim,) standard deviations.  g may have a leading axis, for an
        ensemble of filters.  Raises InvalidInput.
        """
        return checked(f"{type(self).__name__}.belief", self.group, g, covariance, self.side)

    def predict(self, belief: Any, u: Any, h: Any) -> Belief:
        """The belief after a step h with the measured input u.  u : (..., inputs), h : s."""
        belief = self._looked_at("predict", belief)
        if not (h > 0.0 if type(h) is float else np.all(real_array(h, "h") > 0.0)):
            raise InvalidInput(f"{type(self).__name__}.predict: h must be positive; got {h!r}")
        g, covariance = self.propagated(belief.g, belief.covariance, u, h)
        return vouched(Belief(belief.group, g, covariance, self.side))

    def update(self, belief: Any, sensor: Any, z: Any, gate: Any = None) -> Belief:
        """The belief after a measurement z of a sensor.

        gate : a probability, such as 0.999: a measurement whose squared innovation is beyond this
        quantile of chi-square is left out (`accepted` says so).  z : (..., m).
        """
        belief, correction = self._looked_at("update", belief), self._correction("update", sensor, gate)
        require_elements(f"{type(self).__name__}.update: z", sensor, z)
        g, covariance, nis = correction.corrected(belief.g, belief.covariance, z)
        return vouched(Belief(belief.group, g, covariance, self.side, nis, nis <= correction.limit))

    def innovation(self, belief: Any, sensor: Any, z: Any) -> tuple[Any, Any]:
        """The innovation r, (..., m), and its covariance S, (..., m, m)."""
        belief, correction = self._looked_at("innovation", belief), self._correction("innovation", sensor, None)
        require_elements(f"{type(self).__name__}.innovation: z", sensor, z)
        r, S = correction.innovation(belief.g, belief.covariance, z)
        return r, S

    def _looked_at(self, name: str, belief: Any) -> Belief:
        """The belief, one that is made by hand with its arrays checked.  Raises InvalidInput."""
        require(f"{type(self).__name__}.{name}: belief", belief, Belief, "a Belief, as `belief(g, covariance)` gives")
        if belief.group is not self.group and belief.group != self.group:
            raise InvalidInput(
                f"{type(self).__name__}.{name}: the belief is of {belief.group!r}, the filter of {self.group!r}"
            )
        if belief.side != self.side:
            raise InvalidInput(
                f"{type(self).__name__}.{name}: the error of the belief is on the {belief.side}, that "
                f"of the filter on the {self.side}: belief.seen_from({self.side!r})"
            )
        if is_vouched(belief):
            return belief
        return checked(f"{type(self).__name__}.{name}: belief", self.group, belief.g, belief.covariance, self.side)

    def _correction(self, name: str, sensor: Any, gate: Any) -> Correction:
        corrections, gate = self._corrections, None if gate is None else _probability(gate)
        correction = corrections.get((id(sensor), gate))
        if correction is None or correction.sensor is not sensor:
            require(f"{type(self).__name__}.{name}: sensor", sensor, Sensor)
            if sensor.group != self.group:
                raise InvalidInput(
                    f"{type(self).__name__}.{name}: the sensor measures {sensor.group!r}, the filter "
                    f"estimates {self.group!r}"
                )
            correction = self.correction(sensor, _limit(gate, len(sensor.deviation)))
            if len(corrections) > MANY:
                corrections.clear()
            corrections[id(sensor), gate] = correction
        return correction

    _space = property(lambda self: self.process)


MANY = 64
"""Sensors that a filter remembers."""


def _limit(gate: Any, m: int) -> float:
    """The quantile of chi-square with m degrees of freedom."""
    if gate is None:
        return EVERYTHING
    from scipy.special import gammaincinv

    return float(2.0 * gammaincinv(0.5 * m, gate))


def _probability(gate: Any) -> float:
    if not isinstance(gate, (float, int, np.floating)) or not 0.0 < gate < 1.0:
        raise InvalidInput(f"gate is a probability between 0 and 1, such as 0.999; got {gate!r}")
    return float(gate)
