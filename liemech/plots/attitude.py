"""The attitude of a body over time: Euler angles, and the unit quaternion."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..models.poses import attitude, configurations, is_pose
from .components import one_body, times_of
from .style import Axes, legend, look, needs_run, part, plane_axes, thinned, time_label

EULER = ("$\\phi$ (precession)", "$\\theta$ (nutation)", "$\\psi$ (spin)")


def euler_angles(
    run: Any, sequence: str = "ZXZ", *, body: int = 0, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw the Euler angles of the attitude over time, in degrees: g = R_3(phi) R_1(theta) R_3(psi)
    for "ZXZ".

    run : a run that recorded the attitude of a body.  body : which one of an ensemble.
    sequence : of the axes, as SciPy's `Rotation.as_euler` has it; capital letters turn about the
    axes of the body.

    Curves are broken where an angle jumps by more than a right angle, as at the end of a turn, or
    where theta comes close to a multiple of 180 degrees: there only phi + psi or phi - psi means
    something. Returns the axes. Raises InvalidInput without an
    attitude, and for sequences SciPy does not know.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 4.4.
    """
    from scipy.spatial.transform import Rotation

    quaternions = _quaternions(run, body, "plots.euler_angles")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # gimbal lock: the docstring says what is seen then
            angles = Rotation.from_quat(quaternions).as_euler(sequence, degrees=True)
    except ValueError as refused:
        raise InvalidInput(f"plots.euler_angles: sequence = {sequence!r}: {refused}") from None
    ax = plane_axes(ax, title, time_label(run), "angle (degrees)", (6.6, 3.4))
    names = EULER if sequence == "ZXZ" else [f"about {letter}" for letter in sequence]
    samples, t = thinned(len(angles)), times_of(run, body)
    for k, name in enumerate(names):
        ax.plot(*broken(t[samples], angles[samples, k], 90.0), label=name, **look(k))
    legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def quaternion(run: Any, *, body: int = 0, ax: Axes | None = None, title: str | None = None) -> Axes:
    """Draw the unit quaternion of the attitude over time, its vector part (x, y, z) and
    w = cos(angle/2), without jumps of sign.

    run : a run that recorded the attitude of a body.  body : which one of an ensemble.
    Returns the axes. Raises InvalidInput without an attitude.

    Source: Hughes, Spacecraft Attitude Dynamics, section 2.2 (Euler's symmetric parameters).
    """
    q = _quaternions(run, body, "plots.quaternion")
    turned = np.cumprod(np.where(np.einsum("ni,ni->n", q[1:], q[:-1]) < 0.0, -1.0, 1.0))
    q[1:] *= turned[:, None]
    ax = plane_axes(ax, title, time_label(run), "unit quaternion")
    samples, t = thinned(len(q)), times_of(run, body)
    for k, name in enumerate("xyzw"):
        ax.plot(t[samples], q[samples, k], label=f"${name}$", **look(k))
    legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def broken(x: Array, y: Array, jump: float) -> tuple[Array, Array]:
    """A curve with a gap wherever y jumps by more than `jump`."""
    at = np.flatnonzero(np.abs(np.diff(y)) > jump) + 1
    return np.insert(np.asarray(x, dtype=float), at, np.nan), np.insert(y, at, np.nan)


def _quaternions(run: Any, body: int, where: str) -> Array:
    """The attitudes as quaternions (x, y, z, w), (n, 4)."""
    needs_run(run, where)
    if "g" not in run.states or not is_pose(configurations(run.system)):
        raise InvalidInput(
            f"{where} is for runs that recorded the attitude g of a body in space; this one is of {run.system!r}"
        )
    g = part(run, "g", where)
    return np.array(attitude(run.system, g if run.bodies is None else one_body(run, g, body, where)))
