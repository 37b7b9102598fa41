"""A scene in a meshcat.Visualizer that somebody already has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput, InvalidType, MissingExtra
from ..models.poses import carried
from .drawing import Node, commands

if TYPE_CHECKING:
    from .scene import Scene

DISTANCE = 2.8
"""From one panel to the next, which here stand in one space."""

CODES = {"Uint8Array": 0x12, "Uint16Array": 0x14, "Uint32Array": 0x16, "Float32Array": 0x17}
"""The typed arrays of JavaScript in the msgpack that meshcat's page reads."""


class Command:
    """A message to a Visualizer's window: something that can be lowered to a dictionary."""

    def __init__(self, content: dict[str, Any]) -> None:
        self.content = content

    def lower(self) -> dict[str, Any]:
        """The dictionary."""
        return self.content


def send(scene: Scene, visualizer: Any) -> None:
    """Draw a scene below the path of a Visualizer, panel beside panel, and hand over its animation.

    Dots of an ensemble stand where they start: meshcat's animations cannot move them.
    """
    if not hasattr(visualizer, "window") or not hasattr(visualizer, "path"):
        raise InvalidType(f"Scene.send: wanted is a meshcat.Visualizer; got {visualizer!r}")
    root, panels = visualizer.path.lower(), scene.panels()
    if any(node.shape and node.shape.many for panel in panels for node in panel.nodes.values()):
        raise InvalidInput(
            "Scene.send: meshcat cannot move many sites; `save` writes a page that does"
        )
    for k, panel in enumerate(panels):
        place = np.eye(4)
        place[1, 3] = DISTANCE * k
        matrix = place.T.ravel().tolist()
        visualizer.window.send(
            Command({"type": "set_transform", "path": f"{root}/{panel.path}", "matrix": matrix})
        )
    for command in commands(panels):
        visualizer.window.send(
            Command(command | {"path": f"{root}/{command['path']}"} | _packed(command))
        )
    rate = scene.duration / scene.seconds or 1.0
    clocks = [clock / rate for clock in scene.clocks()]
    animations = [
        {
            "path": f"{root}/{node.path}{inner}",
            "clip": {"fps": 1, "name": "default", "tracks": tracks},
        }
        for panel in panels
        for node in panel.nodes.values()
        for inner, tracks in _clips(node, clocks[node.clock].tolist())
    ]
    if animations:
        options = {"play": True, "repetitions": 1}
        visualizer.window.send(
            Command(
                {"type": "set_animation", "animations": animations, "options": options, "path": ""}
            )
        )


def _clips(node: Node, times: list[float]) -> list[tuple[str, list[dict[str, Any]]]]:
    """The tracks of a node, and of the object on it, as three.js names them."""
    tracks: list[dict[str, Any]] = []
    inner: list[dict[str, Any]] = []

    def track(name: str, kind: str, values: np.ndarray) -> dict[str, Any]:
        return {"name": name, "type": kind, "times": times, "values": values.ravel().tolist()}

    for channel, rows in node.moving.items():
        if channel == "position":
            tracks.append(track(".position", "vector3", rows))
        elif channel in ("quaternion", "direction"):
            tracks.append(
                track(
                    ".quaternion", "quaternion", rows if channel == "quaternion" else carried(rows)
                )
            )
        elif channel == "scale":
            tracks.append(track(".scale", "vector3", np.repeat(rows[:, None], 3, axis=1)))
        elif channel == "reveal" and node.shape is not None:
            inner.append(
                track(
                    ".geometry[drawRange].count",
                    "number",
                    node.shape.per_start + node.shape.per_segment * rows,
                )
            )
    return [(where, found) for where, found in (("", tracks), ("/<object>", inner)) if found]


def _packed(command: dict[str, Any]) -> dict[str, Any]:
    """The object of a command with its arrays as msgpack wants them."""
    try:
        from umsgpack import Ext
    except ImportError as missing:
        raise MissingExtra(
            "Scene.send needs umsgpack, which comes with meshcat", extra="viewer"
        ) from missing

    def walk(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: walk(one) for name, one in value.items()}
        if isinstance(value, np.ndarray):
            kind = {"u": "Uint", "f": "Float"}[value.dtype.kind]
            return Ext(
                CODES[f"{kind}{8 * value.dtype.itemsize}Array"],
                np.ascontiguousarray(value).tobytes(),
            )
        return [walk(one) for one in value] if isinstance(value, list) else value

    return {"object": walk(command["object"])} if "object" in command else {}
