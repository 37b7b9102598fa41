"""How strong damping may be under an explicit half kick: it throws a body back where (h/2) C exceeds the inertia.

A half kick of damping C leads from the velocity xi to (1 - (h/2) J^-1 C) xi.  Where J - (h/2) C is not positive on
the velocities that conditions allow, some of them change their sign in every step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import NoConvergence
from ...formulas import Element, Mat, Vec, derivative, identity_matrix, mat, sum, vec, where
from ...formulas.elimination import triangular
from ...systems.kinetic_energy import has_inertia


def negative_pivots(m: Mat, conditions: float = 0.0) -> float:
    """The number of negative pivots of a matrix, those of its first rows, of so many conditions, counted as -1: how many
    eigenvalues are negative on what the conditions leave.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., section 8.1.5 (Sylvester's law of inertia).
    """
    pivots = enumerate(triangular([*m])[1])
    return sum([where(pivot < 0.0, where(k < conditions, -1.0, 1.0), 0.0) for k, pivot in pivots])


def throws_back(system: Any, t: float, mu: Vec, g: Element, h: float) -> bool:
    """Whether a kick of length h by the load of a free body, as it is at its start, turns a velocity round.

    J - h C has a negative eigenvalue then; where the energy is not quadratic, J^-1 - h J^-1 C J^-1 has more of them
    than J^-1.
    """
    xi, body = system.velocity(mu, t), system.body
    quadratic = has_inertia(getattr(body, "lagrangian", None))
    still, turned = [], []  # type: list[Any], list[Any]
    for unit in identity_matrix(len(mu)):
        if quadratic:
            turned = [*turned, body.lagrangian.momentum(unit) - h * system.load.resistance(t, xi, g, unit)]
        else:
            answer = derivative(lambda m: system.velocity(m, t), mu, unit)
            damped = derivative(lambda m: system.velocity(m, t), mu, system.load.resistance(t, xi, g, answer))
            still, turned = [*still, answer], [*turned, answer - h * damped]
    if quadratic:
        return negative_pivots(mat(*turned)) > 0.0
    return negative_pivots(mat(*turned)) > negative_pivots(mat(*still))


def refusal(what: str, ratio: float, h: float, share: float = 1.0) -> NoConvergence:
    """The error of a step h whose first kick throws back.  ratio : of (h/2) C to the inertia, the largest one.
    share : the largest part of a whole step that such a step is, in compositions.
    """
    return NoConvergence(
        f"{what}: c h/(2 I) is {ratio:.4g}, with the damping c there and the inertia I that it slows, and an explicit "
        f"first kick throws back from 1 on. Steps may be {h / (ratio * share):.3g} long at most; a bounded force of your own, "
        "such as friction, says by `resistance` what damps"
    )


def damping_and_slopes(system: Any, t: float, mu: Vec, g: Element) -> tuple[Mat, Mat]:
    """C and J^-1 of a free body, or of one of many sites, which ask the others for what they need."""
    xi, units = system.velocity(mu, t), identity_matrix(len(mu))
    slopes = [derivative(lambda m: system.velocity(m, t), mu, unit) for unit in units]
    return mat(*[system.load.resistance(t, xi, g, unit) for unit in units]), mat(*slopes)


def turns_round(damping: Mat, slopes: Mat, kick: float) -> bool:
    """Whether a kick of this length turns a velocity round."""
    turned = slopes - kick * (slopes @ (damping @ slopes))
    return negative_pivots(turned) > negative_pivots(slopes)


def refusal_by(method: Any, system: Any, damping: Any, slopes: Any, kick: float, h: float) -> NoConvergence:
    """The error of a load with this damping and these slopes, under a kick of this length in a step h."""
    C, S = np.array(damping), np.array(slopes)
    ratio = kick * float(np.linalg.eigvals(0.5 * (C + C.T) @ S).real.max())
    return refusal(f"{method!r}: {system.load!r}", ratio, h)


def bound_refusal(
    method: Any, system: Any, t: float, mu: Vec, g: Element, h: float, share: float = 1.0
) -> NoConvergence:
    """The error of bodies under conditions, in a step of length h; it names the joint of a Linkage."""
    from scipy.linalg import null_space

    whole, load = system._with_rotors if getattr(system, "geared", False) else system, system.body.load
    rows, inverse = (
        matrix.toarray() if hasattr(matrix, "toarray") else np.array(matrix)
        for matrix in (whole._matrix(whole.rows_at(t, g)), system._inverse)
    )
    yields = np.array([*whole.constraint.yields] or [0.0] * len(rows))
    J = np.linalg.inv(inverse)
    for row, light in zip(rows[yields > 0.0], yields[yields > 0.0]):  # a rotor
        J = J + np.outer(row, row) / light
    of_energy = np.linalg.inv(np.linalg.cholesky(J)).T  # velocities of energy 1/2, whatever metres and radians are
    rigid = rows[yields == 0.0] @ of_energy
    free = of_energy @ null_space(rigid / np.linalg.norm(rigid, axis=1)[:, None])
    xi, units = system.velocity(mu), np.eye(len(mu)).tolist()
    damping = np.array([load.resistance(t, xi, g, vec(*unit)) for unit in units])
    values, modes = np.linalg.eigh(0.5 * free.T @ (damping + damping.T) @ free)
    mode = vec(*(free @ modes[:, -1]).tolist())
    return refusal(f"{method!r}: {system.strongest_damper(t, xi, g, mode)}", 0.5 * h * float(values[-1]), h, share)
