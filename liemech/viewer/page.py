"""The page of a scene: one text that holds meshcat's file for browsers, the scene, and the player."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import tempfile
import webbrowser
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingExtra
from ..plots.style import time_unit
from .drawing import MANY, Node, commands

if TYPE_CHECKING:
    from .scene import Scene

HEIGHT = 460
"""Of the frame in a notebook, in pixels."""


def page(scene: Scene, *, compressed: bool = False, socket: str = "") -> str:
    """The page: everything in one text, which fetches nothing.

    compressed : less than half as large; browsers since 2023 open it.  socket : where a live one
    listens.
    """
    content = encoded(described(scene) | ({"socket": socket} if socket else {}))
    connect = f"connect-src {socket}" if socket else "connect-src 'none'"
    parts = {  # the large ones last: every other one is looked for in a short text
        "title": html.escape(scene.title or "liemech"),
        "connect": connect,
        "licence": licence(),
        "kind": ' type="text/plain"' if compressed else "",
        "start": part("unpack.js") if compressed else "startPlayer();",
        "player": packed_code() if compressed else part("player.js"),
        "scene": packed(content.encode()) if compressed else content,
        "asset": "" if compressed else asset(),
    }
    text = part("page.html")
    for name, value in parts.items():
        before, after = text.split(f"<!--{name}-->")
        text = before + value + after
    return text


def described(scene: Scene) -> dict[str, Any]:
    """The scene as data: its panels, the commands that build it, the tracks along which it moves."""
    panels = scene.panels()
    nodes = [node for panel in panels for node in panel.nodes.values()]
    return {
        "start": scene.start,
        "sign": -1 if any(run.motion.t[-1] < run.motion.t[0] for run in scene.shown) else 1,
        "duration": scene.duration,
        "seconds": scene.seconds,
        "view": scene.view,
        "joined": [scene.interpolate and run.motion.joined for run in scene.shown],
        "title": scene.title,
        "legend": scene.legend(),
        "notes": scene.notes(),
        "courses": scene.courses(),
        "unit": scene.unit,
        "length": "m" if time_unit(scene.shown[0].motion.system) == "s" else "",
        "axes": any(content.of_space for run in scene.shown for content in run.contents),
        "panels": [{"path": panel.path, "title": panel.title, **panel.known} for panel in panels],
        "labels": [{"path": node.path, "text": node.label} for node in nodes if node.label],
        "commands": commands(panels),
        "clocks": scene.clocks(),
        "tracks": [track for node in nodes for track in tracks(node)],
    }


def tracks(node: Node) -> list[dict[str, Any]]:
    """The channels of a node that move."""
    channels = []
    still = {channel: rows[None] for channel, rows in node.still.items() if channel in MANY}
    for channel, rows in (still | node.moving).items():
        track: dict[str, Any] = {"path": node.path, "channel": channel, "clock": node.clock}
        if channel == "reveal" and node.shape is not None:  # how many are there at the start
            track |= {"first": node.shape.known["count"] + 1 - len(rows), "least": node.least}
        else:
            track |= {"values": rows.astype(np.float32).ravel(), "width": int(rows[0].size)}
        if channel in MANY and len(rows) > 1:  # two bytes each are enough for a screen
            unit = (float(np.abs(rows).max()) or 1.0) / 32767.0
            track |= {"values": np.round(rows / unit).astype(np.int16).ravel(), "unit": unit}
        channels.append(track)
    return channels


def encoded(content: Any) -> str:
    """JSON that is safe inside a page; arrays as the bytes of a typed array of JavaScript."""

    def array(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            data = base64.b64encode(np.ascontiguousarray(value).data).decode("ascii")
            return {"$": f"{value.dtype.name.title()}Array", "b": data}
        raise TypeError(f"{type(value).__name__} does not go into a page")

    return json.dumps(content, default=array, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


# ------------------------------------------------------------------ the files of the page


@cache
def part(name: str) -> str:
    """A file that lies beside this one."""
    return (resources.files(__package__) / name).read_text(encoding="utf-8")


@cache
def asset_folder() -> Path:
    """The folder where meshcat keeps its page; found without importing it."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise MissingExtra("pages of the viewer need meshcat's file for browsers", extra="viewer")
    return Path(spec.origin).parent / "viewer"


@cache
def asset() -> str:
    """meshcat's file for browsers: three.js, the scene tree, the camera's controls."""
    return (asset_folder() / "dist" / "main.min.js").read_text(encoding="utf-8")


@cache
def licence() -> str:
    """The notices of meshcat and of what it holds, which stay with it."""
    files = asset_folder() / "LICENSE", asset_folder() / "dist" / "main.min.js.LICENSE.txt"
    return "\n".join(file.read_text(encoding="utf-8") for file in files if file.exists()).replace("--", "- -")


def packed(content: bytes) -> str:
    """Compressed, and spelt in letters."""
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode("ascii")


@cache
def packed_code() -> str:
    """meshcat and the player, compressed once."""
    return packed((asset() + "\n" + part("player.js")).encode())


# ------------------------------------------------------------------ where it is shown


def opened(scene: Scene) -> Path:
    """Open the page in the browser.  Returns the temporary file that holds it."""
    file = scene.save(Path(tempfile.mkdtemp(prefix="liemech-")) / "scene.html")
    webbrowser.open(file.as_uri())
    return file


def frame(scene: Scene) -> str:
    """The page in a frame, for notebooks, which can reach nothing of the page around it."""
    content = html.escape(page(scene, compressed=True), quote=True)
    return (
        f'<iframe sandbox="allow-scripts" style="width:100%;height:{HEIGHT}px;border:0" srcdoc="{content}" '
        f'title="{html.escape(scene.title or "liemech", quote=True)}"></iframe>'
    )
