"""From a system to its moving picture: by a run that computes what is shown and nothing else, or step by step."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..integrators.method import Method
from ..simulation.integrate import integrate
from ..systems.system import State, System
from .choice import contents_of
from .live import Live
from .motion import Motion
from .scene import FRAMES, Scene


def animate(
    system: System,
    method: Method,
    start: State,
    show: Any = None,
    *,
    h: float | None = None,
    steps: int | None = None,
    t_end: float | None = None,
    rtol: float | None = None,
    t0: float = 0.0,
    title: str = "",
    seconds: float | None = None,
    frames: int = FRAMES,
) -> Scene:
    """Integrate and show a motion; what is not shown is neither computed nor kept.

    show, title, seconds, frames : as in Scene.  h, steps, or t_end and rtol, t0 : as in
    `integrate`.  Only the parts of the state that are shown, and those the motion depends on, are
    recorded; of a momentum no attitude.  Of fixed steps every k-th is kept, so that there
    are about `frames`; adaptive ones give the states at `frames` times.

    Returns the Scene; `scene.runs[0]` is the run.  Raises what Scene and `integrate` raise.
    """
    parts = frozenset(name for name, x in start.parts.items() if x is not None)
    contents = contents_of(system, parts, start.bodies is not None, show)
    least = [name for name, x in system.essential_part(start).parts.items() if x is not None]
    needed = {*least, *(part for content in contents for part in content.needs(system))}
    record = [name for name in start.parts if name in needed]
    arguments: dict[str, Any] = {"h": h, "steps": steps, "rtol": rtol, "record": record, "t0": t0}
    if t_end is not None:
        arguments |= {"t_end": t_end, "t_eval": np.linspace(t0, t_end, frames), "dense": False}
    elif isinstance(steps, (int, np.integer)):
        arguments["every"] = max(1, -(-steps // frames))
    run = integrate(system, method, start, **arguments)
    return Scene(run, contents, title=title, seconds=seconds, frames=frames)


def live(system: System, start: State, show: Any = None, *, title: str = "", open: bool = True) -> Live:
    """Open a page that shows a motion step by step, as it is computed: `display` moves it.

    show, title : as in Scene.  open : in the browser, now; otherwise go to `url`.
    """
    return Scene(Motion.moment(system, 0.0, start), show, title=title).live(open=open)
