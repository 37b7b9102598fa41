"""Andrews' squeezing mechanism: seven bodies in a plane, three closed loops, a motor; a benchmark
of constrained dynamics.
"""

from __future__ import annotations

from typing import ClassVar

from ...formulas import Mat, Vec, cos, mat, record, sin, sqrt, vec
from ...rooms.constraints.constrained import ConstrainedLagrangianSystem
from ...systems.canonical import CanonicalState

M1, M2, M3, M4, M5, M6, M7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498  # kg
# kg m^2
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
# m, as all that follow
XA, YA, XB, YB, XC, YC = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
D, DA, E, EA, RR, RA, SS, SA, SB, SC, SD = (
    0.028,
    0.0115,
    0.02,
    0.01421,
    0.007,
    0.00092,
    0.035,
    0.01874,
    0.01043,
    0.018,
    0.02,
)
TA, TB, U, UA, UB, ZF, ZT, FA = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421


@record
class AndrewsMechanism(ConstrainedLagrangianSystem):
    """Seven bodies in a plane, driven by a constant moment and held by a spring, in seven angles
    with six conditions.

    moment : of the motor on the first angle, in N m.  stiffness : of the spring, in N/m.
    rest : its length without a load, in m.
    q : the angles (beta, Theta, gamma, Phi, delta, Omega, epsilon), (7,), in rad.  p : M(q) q'.
    The first two conditions close the loop through B, the others those through A, in m.
    `from_rest` is the start of the benchmark.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., VII.7; Mazzia
    and Magherini, Test Set for Initial Value Problem Solvers (2008), II-10; Gonzalez et al.,
    Multibody Syst. Dyn. 16 (2006) (problem A03).
    """

    degrees: ClassVar[int] = 7

    moment: float = 0.033
    stiffness: float = 4530.0
    rest: float = 0.07785

    def mass(self, q: Vec) -> Mat:
        """M(q), (7, 7), in kg m^2.  q : (7,)."""
        _, theta, _, phi, _, omega, _ = q
        c, e, z = DA * RR * cos(theta), E - EA, ZF - FA
        swing, turn = ZT * e * sin(phi), U * z * sin(omega)
        m11 = M1 * RA**2 + M2 * (RR**2 - 2.0 * c + DA**2) + I1 + I2
        m12, m22 = M2 * (DA**2 - c) + I2, M2 * DA**2 + I2
        m33 = M3 * (SA**2 + SB**2) + I3
        m44, m45 = M4 * e**2 + I4, M4 * (e**2 + swing) + I4
        m55 = M4 * (ZT**2 + 2.0 * swing + e**2) + M5 * (TA**2 + TB**2) + I4 + I5
        m66, m67 = M6 * z**2 + I6, M6 * (z**2 - turn) + I6
        m77 = M6 * (z**2 - 2.0 * turn + U**2) + M7 * (UA**2 + UB**2) + I6 + I7
        return mat(
            vec(m11, m12, 0.0, 0.0, 0.0, 0.0, 0.0),
            vec(m12, m22, 0.0, 0.0, 0.0, 0.0, 0.0),
            vec(0.0, 0.0, m33, 0.0, 0.0, 0.0, 0.0),
            vec(0.0, 0.0, 0.0, m44, m45, 0.0, 0.0),
            vec(0.0, 0.0, 0.0, m45, m55, 0.0, 0.0),
            vec(0.0, 0.0, 0.0, 0.0, 0.0, m66, m67),
            vec(0.0, 0.0, 0.0, 0.0, 0.0, m67, m77),
        )

    def potential(self, q: Vec) -> float:
        """The energy of the spring, less the moment times beta, in J.  q : (7,)."""
        c, s = cos(q[2]), sin(q[2])
        x, y = SD * c + SC * s + XB - XC, SD * s - SC * c + YB - YC
        stretch = sqrt(x * x + y * y) - self.rest
        return 0.5 * self.stiffness * stretch * stretch - self.moment * q[0]

    def constraint(self, q: Vec) -> Vec:
        """The loops are closed, (6,), in m.  q : (7,)."""
        beta, theta, gamma, phi, delta, omega, epsilon = q
        x, y = RR * cos(beta) - D * cos(beta + theta), RR * sin(beta) - D * sin(beta + theta)
        return vec(
            x - SS * sin(gamma) - XB,
            y + SS * cos(gamma) - YB,
            x - E * sin(phi + delta) - ZT * cos(delta) - XA,
            y + E * cos(phi + delta) - ZT * sin(delta) - YA,
            x - ZF * cos(omega + epsilon) - U * sin(epsilon) - XA,
            y - ZF * sin(omega + epsilon) + U * cos(epsilon) - YA,
        )

    def from_rest(self) -> CanonicalState:
        """The start of the benchmark: Theta = 0, no velocity."""
        return self.state(
            [
                *(-0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885),
                *(0.487364979543842550, -0.222668390165885885, 1.230547444549821192),
            ],
            [0.0] * 7,
        )
