"""Sensors: a value that an element predicts, and the residual of a measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput, undefined
from ..formulas import Ambient, Element, Mat, Record, Vec, mat, record, vec
from ..formulas.arrays import real_array
from ..groups.composed.product import ProductGroup
from ..groups.lie_group import LieGroup
from .errors_of_elements import check_side, error
from .noise import INFINITY, TINY, check_noise


@record
class Sensor(Record):
    """A measurement z of an element of a group: z = value(g) + noise.

    must:  `group` and `deviation` (fields or properties), `value`
    may:   `residual`, for measurements that are elements themselves; `covariance`, for noise that is
           correlated; `value_shape`

    Derivatives are derived from `residual`.

    deviation : (m,) of the independent components of the noise, in units of the residual.

    Source: Sarkka, Bayesian Filtering and Smoothing, 2nd ed., section 5.2.
    """

    if TYPE_CHECKING:  # a field here would be one of every subclass

        @property
        def group(self) -> Any: ...

        @property
        def deviation(self) -> Any: ...

    def value(self, g: Element) -> Vec:
        """The value that an exact sensor measures at g."""
        raise undefined(self, "value")

    def residual(self, g: Element, z: Ambient) -> Vec:
        """z - value(g), (m,): how far the measurement is from what g predicts."""
        return z - self.value(g)

    def covariance(self, g: Element) -> Mat:
        """The covariance of the residual, (m, m): diagonal, the squares of `deviation`."""
        s = self.deviation
        return mat(*[[s[i] * s[i] if i == j else 0.0 for j in range(len(s))] for i in range(len(s))])

    @property
    def value_shape(self) -> tuple[int, ...]:
        """The shape of z: that of an element of the group `elements`, or else that of the residual."""
        return (len(self.deviation),) if self.elements is None else self.elements.element_shape

    @property
    def elements(self) -> LieGroup | None:
        """The group of which measurements are elements; None, the default: they are vectors."""
        return None

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.value_shape if argument == "z" else self.group._shape(argument, kind)

    def _complex(self, kind: str) -> bool:
        group = self.elements if kind == "Ambient" else self.group
        return group is not None and group._complex(kind)

    def _objection(self, argument: str, value: Any) -> str | None:
        return None if argument == "z" else self.group._objection(argument, value)


def require_elements(where: str, sensor: Sensor, z: Any) -> None:
    """Refuse measurements that are to be elements of a group and are none.  z : (..., m).  Raises InvalidInput."""
    group = sensor.elements
    if group is not None and not np.all(group.contains(z)):
        array = real_array(z, where, group.is_complex).reshape(-1, *group.element_shape)
        raise InvalidInput(f"{where} is not in {group!r}: {next(filter(None, map(group.objection, array)), None)}")


@record
class Place(Sensor):
    """The element itself is measured, z = g exp(noise): star trackers on SO(3), motion capture and loop
    closures on SE(3).

    The residual is log(g^-1 z), or log(z g^-1) with side="right", where the noise is seen from space.

    deviation : (dim,).

    Source: Sola, Deray, Atchuthan, A micro Lie theory for state estimation in robotics (2018), section
    IV.
    """

    group: LieGroup
    deviation: Vec
    side: str = "left"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_side("Place", self.side)
        check_noise(self, TINY, deviation=self.group.dim)

    def value(self, g: Element) -> Element:
        """The element g itself, which is measured."""
        return g

    def residual(self, g: Element, z: Ambient) -> Vec:
        """log(g^-1 z), or log(z g^-1), (dim,)."""
        return error(self.group, self.side, self.value(g), z)

    @property
    def elements(self) -> LieGroup:
        return self.group


@record
class Direction(Sensor):
    """A direction known in space is measured in the body, z = R^T d: magnetometers, sun sensors,
    accelerometers at rest, single stars.

    On SO(3), SE(3), SE_2(3), SGal(3).  known : (3,) in space.  deviation : (3,).

    Source: Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
    section 6.2.
    """

    group: LieGroup
    known: Vec
    deviation: Vec

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_rotations(self, 3)
        check_noise(self, -INFINITY, known=3)
        check_noise(self, TINY, deviation=3)

    def value(self, g: Element) -> Vec:
        """The known direction seen from the body, R^T d, (3,)."""
        d = self.known
        return vec(*[g[0, i] * d[0] + g[1, i] * d[1] + g[2, i] * d[2] for i in range(3)])


@record
class Position(Sensor):
    """The position of a point of the body is measured in space, z = p + R lever: satellite navigation.

    On SE(3), SE_2(3), SGal(3), whose last column is p.  deviation : (3,), m.  lever : (3,) of the
    antenna in the body, m.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), section V.
    """

    group: LieGroup
    deviation: Vec
    lever: Vec = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_rotations(self, 4)
        check_noise(self, TINY, deviation=3)
        check_noise(self, -INFINITY, lever=3)

    def value(self, g: Element) -> Vec:
        """The position of the end of the lever, p + R lever, (3,)."""
        x, last = self.lever, len(g) - 1
        at = [g[i, 0] * x[0] + g[i, 1] * x[1] + g[i, 2] * x[2] for i in range(3)]
        return vec(*[g[i, last] + at[i] for i in range(3)])


@record
class Landmark(Sensor):
    """A point known in space is measured from the body, z = R^T (point - p): cameras with depth, lidar.

    On SE(3), SE_2(3), SGal(3).  point : (3,) in space, m.  deviation : (3,), m.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), section V.
    """

    group: LieGroup
    point: Vec
    deviation: Vec

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_rotations(self, 4)
        check_noise(self, TINY, deviation=3)
        check_noise(self, -INFINITY, point=3)

    def value(self, g: Element) -> Vec:
        """The landmark seen from the body, R^T (point - p), (3,)."""
        last = len(g) - 1
        d = [self.point[i] - g[i, last] for i in range(3)]
        return vec(*[g[0, i] * d[0] + g[1, i] * d[1] + g[2, i] * d[2] for i in range(3)])


def _require_rotations(sensor: Any, columns: int) -> None:
    """Refuse groups whose elements have no rotation in their first three columns, or no position in a last one."""
    group, shape = sensor.group, sensor.group.element_shape
    if len(shape) == 2 and shape[0] >= columns:
        g = np.asarray(group.exp(np.linspace(0.3, 0.7, group.dim)))
        if np.allclose(g[:3, :3].T @ g[:3, :3], np.eye(3)) and not g[3:, :3].any():
            return
    raise InvalidInput(
        f"{type(sensor).__name__}: group is {'SO(3), ' * (columns == 3)}SE(3), SE_2(3) or SGal(3); got {group!r}.  "
        "For one factor of a product write OfPart(product, 0, sensor)"
    )


@record
class OfPart(Sensor):
    """A sensor of one factor of a product, such as the attitude beside biases.

    group : the product.  part : which factor, from 0 on.  sensor : of that factor.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12.
    """

    group: ProductGroup
    part: int
    sensor: Sensor

    def __post_init__(self) -> None:
        super().__post_init__()
        factors = self.group.factors
        if not 0 <= self.part < len(factors) or factors[self.part] != self.sensor.group:
            raise InvalidInput(f"OfPart: factor {self.part} of {self.group!r} is not {self.sensor.group!r}")

    @property
    def deviation(self) -> Vec:
        """The deviations of the sensor of this part."""
        return self.sensor.deviation

    def value(self, g: Element) -> Any:
        return self.sensor.value(self.group.split(g)[self.part])

    def residual(self, g: Element, z: Ambient) -> Vec:
        return self.sensor.residual(self.group.split(g)[self.part], z)

    def covariance(self, g: Element) -> Mat:
        return self.sensor.covariance(self.group.split(g)[self.part])

    @property
    def value_shape(self) -> tuple[int, ...]:
        return self.sensor.value_shape

    @property
    def elements(self) -> LieGroup | None:
        return self.sensor.elements
