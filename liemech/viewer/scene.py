"""A scene: what is shown of which runs.  Plain data, from which pages, pictures and streams are made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import real_array
from ..models.curves import ASIDE
from ..models.poses import flies
from ..plots import COLORS
from ..plots.style import time_unit
from .choice import contents_of, has_floor
from .contents.content import Content
from .drawing import Canvas, Drawing
from .live import Live
from .motion import Motion
from .page import frame, opened, page
from .shapes import rgb
from .snapshot import file_that_ends, snapshot, write_film
from .thinning import MOST_NUMBERS

FRAMES = 900
"""Samples of a run that a scene keeps: fifteen seconds at sixty pictures a second."""

PACE = 3.0
"""Samples in a second of playing where they are too far apart to be joined, and more would flicker.

Source: Web Content Accessibility Guidelines 2.2, 2.3.1 (three flashes).
"""

ENSEMBLE_FRAMES = 300
"""Of an ensemble fewer, and no more than a page below 20 MB holds of all its bodies."""


@dataclass(frozen=True, eq=False)
class ShownRun:
    """A run in a scene: what is shown of it, its name and colour."""

    motion: Motion
    contents: tuple[Content, ...]
    name: str
    color: str
    note: str = ""


class Scene:
    """A picture that moves, of one or several runs, side by side and in time: a page that plays them in any
    browser.

        Scene(run).show()
        Scene(run, show=("body", "momentum")).save("body.html")

    run : what `integrate` returns, or a `Motion(system, t, states)`.
    show : names, "body", "momentum", "spatial momentum", "vertical", "points",
    "links", "spins", "sites", "rod", "field", or contents with options, such as Momentum(levels=0).  Left out: what suits the
    system.  Nothing else is computed or written.
    name, color : of the run in the legend, "#rrggbb".  body : the one to show of an ensemble.
    sites : the numbers of those to show of many; left out, all, or of more than 12,000 every third
    along each axis, or fifth, ...
    title : of the page.  seconds : how long it plays; default: as long as the motion, but 5 to 15
    s, and so long that samples too far apart to be joined are shown three a second.
    frames : samples that are kept of each run, evenly chosen; the data of the run are not touched.
    interpolate : move between the samples, of adaptive steps by their dense output; False shows the
    steps one after another.
    view : (azimuth, elevation) of the eye in degrees; left out, across the plane of the motion.
    unit : of the times, such as "d"; left out, that of the system, which is "s" or nothing.
    note : something that the page says of the run.

    `add` puts another run into the scene.  Momenta share a sphere; bodies that stay where they are
    stand side by side.
    Raises InvalidInput if a run has not recorded what is shown, or has not got it.
    """

    def __init__(
        self,
        run: Any = None,
        show: Any = None,
        *,
        name: str = "",
        color: str | None = None,
        body: int | None = None,
        sites: Any = None,
        title: str = "",
        seconds: float | None = None,
        frames: int = FRAMES,
        interpolate: bool = True,
        view: tuple[float, float] | None = None,
        unit: str | None = None,
        note: str = "",
    ) -> None:
        if seconds is not None and not 0.0 < float(real_array(seconds, "Scene: seconds")) < math.inf:
            raise InvalidInput(f"Scene: seconds must be positive and finite; got {seconds!r}")
        if int(real_array(frames, "Scene: frames")) < 2:
            raise InvalidInput(f"Scene: frames must be 2 or more; got {frames!r}")
        if view is not None:
            angles = real_array(view, "Scene: view")
            if angles.shape != (2,) or not np.isfinite(angles).all():
                raise InvalidInput(f"Scene: view is (azimuth, elevation) in degrees; got {view!r}")
        self.title, self.frames, self.interpolate = title, int(frames), bool(interpolate)
        self._seconds, self._view, self._unit = seconds, view, unit
        self.shown: list[ShownRun] = []
        self.runs: list[Any] = []
        if run is not None:
            self.add(run, show, name=name, color=color, body=body, sites=sites, note=note)

    def add(
        self,
        run: Any,
        show: Any = None,
        *,
        name: str = "",
        color: str | None = None,
        body: int | None = None,
        sites: Any = None,
        note: str = "",
    ) -> Scene:
        """Put another run into the scene; arguments as above.  Returns the scene."""
        bodies, frames = getattr(run, "bodies", None), self.frames
        if bodies is not None and body is None:
            frames = min(frames, ENSEMBLE_FRAMES, max(2, MOST_NUMBERS // (7 * bodies)))
        motion = Motion.of_run(run, frames, body, self.interpolate, sites)
        have = frozenset(motion.states)
        contents = contents_of(motion.system, have, motion.bodies is not None, show)
        color = color or COLORS[len(self.shown) % len(COLORS)]
        rgb(color)
        backwards = motion.t[-1] < motion.t[0]
        if self.shown and len(motion) > 1 and backwards != (self._sign() < 0.0) and self.duration:
            raise InvalidInput("Scene.add: this run goes the other way in time; give it a scene of its own")
        self.shown.append(ShownRun(motion, contents, name, color, note))
        self.runs.append(run)
        return self

    # ---------------------------------------------------------------- time

    @property
    def start(self) -> float:
        """The first time, in s."""
        return float(self._sign() * min(self._sign() * run.motion.t[0] for run in self._runs()))

    @property
    def duration(self) -> float:
        """The time from the first sample to the last, in s."""
        return float(max(clock[-1] for clock in self.clocks()))

    @property
    def unit(self) -> str:
        """The unit of the times: what was given, or that of the first system."""
        return time_unit(self._runs()[0].motion.system) if self._unit is None else self._unit

    @property
    def seconds(self) -> float:
        """How long the scene plays at ordinary speed, in s."""
        apart = [len(run.motion) / PACE for run in self.shown if not run.motion.joined]
        return self._seconds or max([min(max(self.duration, 5.0), 15.0), *apart])

    def _sign(self) -> float:
        return -1.0 if any(run.motion.t[-1] < run.motion.t[0] for run in self.shown) else 1.0

    def clocks(self) -> list[np.ndarray]:
        """The times of each run, counted from the start of the scene."""
        return [self._sign() * (run.motion.t - self.start) for run in self._runs()]

    # ---------------------------------------------------------------- what it is made of

    @property
    def view(self) -> tuple[float, float]:
        """Azimuth and elevation of the eye, in degrees."""
        if self._view is not None:
            return self._view
        eyes = {c.eye(run.motion) for run in self._runs() for c in run.contents}
        return eyes.pop() if len(eyes) == 1 else ASIDE

    def legend(self) -> list[dict[str, Any]]:
        """The colours of the runs that have names, and other meanings of colours, each said once."""
        runs = enumerate(self._runs())
        entries: list[dict[str, Any]] = [{"name": r.name, "color": r.color, "run": k} for k, r in runs if r.name]
        for run in self.shown:
            for content in run.contents:
                entries += [entry for entry in content.legend(run.motion) if entry not in entries]
        return entries

    def courses(self) -> list[dict[str, Any]]:
        """The differences of quantities of the runs from their first values, at the times of each run."""
        return [
            {
                "name": name,
                "run": k,
                "color": run.color,
                "rounding": float(np.spacing(abs(values[0]))),
                "values": (values - values[0]).astype(np.float32),
            }
            for k, run in enumerate(self._runs())
            for content in run.contents
            for name, values in content.courses(run.motion).items()
            if len(values) > 1
        ]

    def notes(self) -> list[str]:
        """Remarks on the runs: what the pictures leave out of them, what is not to scale, why one ended early."""
        remarks: list[str] = []
        for run in self._runs():
            texts = [run.note, run.motion.note and f"shown: {run.motion.note}"]
            remarks += [f"{run.name}: {text}" if run.name and text else text for text in texts]
            remarks += [content.note(run.motion) for content in run.contents]
        return [text for text in dict.fromkeys(remarks) if text]

    def _runs(self) -> list[ShownRun]:
        if not self.shown:
            raise InvalidInput("this scene is empty; put a run into it, scene.add(run)")
        return self.shown

    def _pictures(self) -> list[tuple[str, list[tuple[int, Content]]]]:
        """Each panel: its path, and the contents in it with the numbers of their runs."""
        panels: dict[Any, list[tuple[int, Content]]] = {}
        for run, shown in enumerate(self._runs()):
            for content in shown.contents:
                system = shown.motion.system
                place = run if content.own(system) else len(self.shown)  # those shared come last
                key = place, content.panel, system if content.alike else None
                panels.setdefault(key, []).append((run, content))
        ordered = sorted(panels.items(), key=lambda item: item[0][0])
        return [(f"panel {n}", members) for n, (_, members) in enumerate(ordered, start=1)]

    def places(self, run: int) -> list[tuple[str, Content]]:
        """The contents of a run, each with the path of its panel."""
        return [(path, c) for path, members in self._pictures() for k, c in members if k == run]

    def panels(self) -> list[Canvas]:
        """The pictures side by side, drawn."""
        panels = []
        for path, members in self._pictures():
            runs = sorted({run for run, _ in members})
            named = len(runs) == 1 < len(self.shown)
            panel = _framed(path, [(self.shown[run], c) for run, c in members], named)
            panel.known = {"runs": runs, **_known(self.shown[runs[0]].motion.system, members[0][1], panel.unit)}
            for run, content in members:
                shown = self.shown[run]
                content.draw(shown.motion, Drawing(panel, f"run {run + 1}", shown.color, run))
            panels.append(panel)
        return panels

    # ---------------------------------------------------------------- where it goes

    html, show, _repr_html_ = page, opened, frame
    snapshot, write_film = snapshot, write_film

    def save(self, path: str | PathLike[str], *, compressed: bool = False) -> Path:
        """Write the page to a file, which opens from disk, in a notebook and from every web host. Returns its path."""
        file = file_that_ends(path, ".html", ".htm")
        file.write_text(self.html(compressed=compressed), encoding="utf-8")
        return file

    def live(self, *, open: bool = True) -> Live:
        """Show the scene in a browser on this machine, and let `display` move it, state by state."""
        return Live(self, open)

    def __repr__(self) -> str:
        runs = [
            ", ".join(type(c).__name__ for c in run.contents) + (f" of {run.name!r}" if run.name else "")
            for run in self.shown
        ]
        return f"Scene({'; '.join(runs)})"


def _known(system: Any, content: Content, unit: float) -> dict[str, Any]:
    """Whether a panel with this content is a main one, stands over a floor, and has a length to measure."""
    floor = content.of_space and has_floor(system)
    of_places = floor or getattr(system, "degrees", 2) > 1  # not the plane of one position and its momentum
    ruler = unit if (content.to_scale and of_places) or (content.panel == "space" and flies(system)) else 0.0
    return {"main": content.main, "floor": floor, "ruler": ruler}


def _framed(path: str, members: Sequence[tuple[ShownRun, Content]], named: bool) -> Canvas:
    """An empty panel that is large enough for its contents."""
    first, content = members[0]
    title = content.title
    if named and first.name:  # beside others a body has no room for more
        title = f"{first.name}: {title}" if content.main else first.name
    points = np.concatenate([c.reach(run.motion) for run, c in members])
    low, high = points.min(axis=0), points.max(axis=0)
    centre = low + 0.5 * (high - low)
    unit = float(np.linalg.norm(points - centre, axis=1).max())
    return Canvas(path, title, centre, unit or 1.0)
