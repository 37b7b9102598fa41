"""Points of spaces and elements of groups that users give, one or many, checked; and as fields of states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import check_finite, real_array
from ..formulas.arrays import at_a_glance
from ..formulas.calls.batches import MEMBERSHIP
from ..formulas.classes.fields import frozen_array
from ..formulas.classes.signatures import bare
from ..formulas.large import Large
from ..formulas.vectors import small
from ..groups.lie_group import LieGroup


def points(
    value: Any,
    name: str,
    shape: tuple[int, ...],
    space: str,
    or_complex: bool = False,
    advice: Callable[[tuple[int, ...], tuple[int, ...]], str] = lambda found, shape: "",
) -> np.ndarray:
    """An array of one or, with a leading axis, many points of a space; InvalidInput names what is
    wrong.

    advice : what to do with an array of another shape.
    """
    array = real_array(value, name, or_complex)
    if array.shape != shape and array.shape[1:] != shape:
        ensemble_shape = ("bodies", *shape)
        raise InvalidInput(
            f"{name} has shape {array.shape}; {space} has shape {shape}, many of them {ensemble_shape}".replace("'", "")
            + advice(array.shape, shape)
        )
    if not array.size and shape != (0,):
        raise InvalidInput(f"{name} has shape {array.shape}; an ensemble needs at least one body")
    check_finite(array, name)
    return array


def element_at_a_glance(group: LieGroup, value: Any) -> Any:
    """A real array that is an element, as a small vector or matrix; None for anything else."""
    element = None if group.is_large else at_a_glance(value, group.element_shape)
    if element is None or group.is_complex or not bare(type(group).defect)(group, element) <= MEMBERSHIP:
        return None
    return element


def members_of(group: LieGroup, value: Any, name: str) -> np.ndarray:
    """An array of one or many elements of a group."""
    shape = group.element_shape
    array = points(value, name, shape, f"an element of {group!r}", group.is_complex, _other_rotation)
    is_ensemble = array.shape != shape
    if not is_ensemble and not group.is_large and group.contains(small(array)):
        return array
    outside = np.flatnonzero(~np.atleast_1d(group.contains(array)))
    if len(outside):
        label = f"{name}[{outside[0]}]" if is_ensemble else name
        raise InvalidInput(f"{label} {group._objection('g', array[outside[0]] if is_ensemble else array)}")
    return array


def _other_rotation(found: tuple[int, ...], shape: tuple[int, ...]) -> str:
    """The cure for a rotation in another representation than that of the group."""
    if shape == (4,) and found[-2:] == (3, 3):
        return ": of a matrix take UnitQuaternions().from_matrix(R), of a scipy Rotation r from_matrix(r.as_matrix())"
    if shape == (3, 3) and found[-1:] == (4,):
        return (
            ": of a quaternion q = (x, y, z, w), the order of scipy, take UnitQuaternions().matrix(q), "
            "of (w, x, y, z) that of np.roll(q, -1); or let the body turn by quaternions, "
            "group=UnitQuaternions()"
        )
    if shape == (3, 3) and found[-1:] == (3,):
        return ": of a rotation vector take SO3().exp(v); of Euler angles scipy's Rotation.from_euler"
    return ""


def large_members(state: Any, large: bool) -> Any:
    """The state, which remembers whether its members lie in memory."""
    if large:
        object.__setattr__(state, "large", True)
    return state


def as_field(array: np.ndarray, one: tuple[int, ...], bodies: int | None, large: bool = False) -> Any:
    """A field of a state: a small vector or matrix for a single body, else a read-only array with a row for each body.
    large : does the field of a single body lie in memory?
    """
    if bodies is None:
        return Large(array) if large else small(array)
    return frozen_array(np.broadcast_to(array, (bodies, *one)), "array")
