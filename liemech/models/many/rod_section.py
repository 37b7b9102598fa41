"""Cross sections of rods: stiffness and inertia by shape and material."""

from __future__ import annotations

import math

import numpy as np

from ...errors import InvalidInput
from ...formulas import Record, Vec, record
from ..input_checks import check_positive


@record
class RodSection(Record):
    """The cross section of a rod along e3, in principal axes e1, e2: how stiff it is and how heavy.

    stiffness : (EI_1, EI_2, GJ, kGA_1, kGA_2, EA), against bending about e1 and e2 and torsion, in
    N m^2, and against shear along e1 and e2 and stretch, in N.
    inertia : per length, (rho I_1, rho I_2, rho (I_1 + I_2), rho A, rho A, rho A), in kg m and kg/m.
    `round`, `tube` and `rectangle` make both of a shape and a material.
    Raises InvalidInput unless all are positive.

    Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985), section 5; Antman, Nonlinear Problems
    of Elasticity, 2nd ed., chapter 8.
    """

    stiffness: Vec
    inertia: Vec

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "stiffness", "inertia")
        for name in ("stiffness", "inertia"):
            if len(getattr(self, name)) != 6:
                raise InvalidInput(
                    f"RodSection: {name} has six components, (bending, bending, torsion, shear, shear, "
                    f"stretch); got {len(getattr(self, name))}"
                )

    @property
    def radius(self) -> float:
        """2 sqrt(EI/EA), that of a full circle which bends as easily, in m."""
        return float(2.0 * np.sqrt(min(self.stiffness[0], self.stiffness[1]) / self.stiffness[5]))

    @classmethod
    def of(
        cls, area: float, I1: float, I2: float, torsion: float, shear: float, young: float,
        density: float, poisson: float,
    ) -> RodSection:  # fmt: skip
        """The section of an area, its second moments about e1 and e2, its torsion constant and its shear
        coefficient.
        """
        if not -1.0 < poisson <= 0.5:
            raise InvalidInput(f"RodSection: poisson is above -1 and at most 1/2; got {poisson:g}")
        G = 0.5 * young / (1.0 + poisson)
        kGA = shear * G * area
        return cls(
            [young * I1, young * I2, G * torsion, kGA, kGA, young * area],
            [density * x for x in (I1, I2, I1 + I2, area, area, area)],
        )

    @classmethod
    def round(cls, radius: float, young: float, density: float, poisson: float = 0.3) -> RodSection:
        """A full circle.  radius : in m.  young : Young's modulus, in Pa.  density : in kg/m^3.
        poisson : Poisson's ratio.

        Source: Cowper, J. Appl. Mech. 33 (1966), 335 (the shear coefficient).
        """
        return cls.tube(radius, 0.0, young, density, poisson)

    @classmethod
    def tube(cls, radius: float, inner: float, young: float, density: float, poisson: float = 0.3) -> RodSection:
        """A circle with a hole of radius `inner`; the others are as for `round`.

        Source: Cowper, J. Appl. Mech. 33 (1966), 335.
        """
        if not 0.0 <= inner < radius < np.inf:
            raise InvalidInput(
                f"RodSection: radius must be positive, and inner between 0 and it; got {radius:g} and {inner:g}"
            )
        area = math.pi * (radius + inner) * (radius - inner)
        I = 0.25 * area * (radius**2 + inner**2)
        m = (2.0 * radius * inner / (radius**2 + inner**2)) ** 2  # (2 m/(1 + m^2))^2, m = inner/radius
        shear = 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson + m * (5.0 + 3.0 * poisson))
        return cls.of(area, I, I, 2.0 * I, shear, young, density, poisson)

    @classmethod
    def rectangle(cls, width: float, height: float, young: float, density: float, poisson: float = 0.3) -> RodSection:
        """A rectangle, `width` along e1 and `height` along e2, in m; the others are as for `round`.

        Source: Cowper, J. Appl. Mech. 33 (1966), 335 (the shear coefficient); Timoshenko and
        Goodier, Theory of Elasticity, 3rd ed., section 109 (Saint-Venant's torsion).
        """
        if not (0.0 < width < np.inf and 0.0 < height < np.inf):
            raise InvalidInput(f"RodSection: width and height must be positive; got {width:g} and {height:g}")
        b, a = sorted((width, height))
        n = np.arange(1.0, 100.0, 2.0)
        series = float(np.sum(np.tanh(0.5 * math.pi * n * a / b) / n**5))
        torsion = a * b**3 * (1.0 / 3.0 - 64.0 / math.pi**5 * (b / a) * series)
        shear = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
        I1, I2 = width * height**3 / 12.0, height * width**3 / 12.0
        return cls.of(width * height, I1, I2, torsion, shear, young, density, poisson)
