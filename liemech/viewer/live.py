"""States shown as they come: a page on this machine, fed by a thread of this process."""

from __future__ import annotations

import asyncio
import atexit
import json
import secrets
import threading
import webbrowser
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidInput, MissingExtra
from ..systems.system import State
from .drawing import RANK, Drawing
from .motion import Motion
from .shapes import Shape, number

if TYPE_CHECKING:
    from .scene import Scene

RATE = 60.0
"""Pictures a second, at most: of states that come faster the last one is shown."""


@dataclass(frozen=True)
class Pen(Drawing):
    """Draws a single state into a scene that stands: no shapes, only where they are now."""

    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)
    trails: dict[str, list[list[float]]] = field(default_factory=dict)

    def add(
        self, path: str, shape: Shape | None = None, label: str = "", **channels: ArrayLike
    ) -> None:
        """Where a node is."""
        now = {}
        for channel, values in channels.items():
            rows = np.asarray(values, dtype=float)
            now[channel] = (rows if rows.ndim == RANK[channel] else rows[0]).ravel().tolist()
        self.nodes[f"{self.panel.path}/{self.name}/{path}"] = now

    def once(self, path: str, shape: Shape, label: str = "", **channels: ArrayLike) -> None:
        """Nothing to do: all runs share what is there already."""

    def trail(
        self,
        path: str,
        points: NDArray[np.float64],
        color: str | None = None,
        fading: bool = True,
    ) -> None:
        """The newest point."""
        self.trails[f"{self.panel.path}/{self.name}/{path}"] = points[-1:].tolist()


class Live:
    """A scene in a browser on this machine, moved state by state; a context manager.

        motion = plan.stepper(start)
        with lm.viewer.live(body, start) as view:
            for _ in range(1000):
                motion.step()
                view.display(motion.state, motion.t)

    The page listens to one thread of this process, on 127.0.0.1 and a port that the system chooses;
    nothing else runs, and nothing is left behind.  `display` only hands over the state: drawing is
    left to the thread, at most 60 times a second, and is not done while nobody looks.  A page that
    is opened later, or loaded again, shows the last state.

    url : the page; whoever knows it can look, from this machine.
    """

    def __init__(self, scene: Scene, open: bool = True) -> None:
        try:
            from tornado.netutil import bind_sockets
        except ImportError as missing:
            raise MissingExtra(
                "a live scene needs tornado, which comes with meshcat", extra="viewer"
            ) from missing
        self._scene, self._panels = scene, {panel.path: panel for panel in scene.panels()}
        self._states: dict[int, tuple[float, State]] = {}
        self._pages: set[Any] = set()
        self._waiting, self._closed, self._seen = False, False, threading.Event()
        self._lock = threading.Lock()
        self._refused: Exception | None = None
        self._shown: dict[int, tuple[float, State]] | None = None
        sockets = bind_sockets(0, "127.0.0.1")
        # unknown to others on this machine
        self._address = f"127.0.0.1:{sockets[0].getsockname()[1]}/{secrets.token_urlsafe(9)}"
        self.url = f"http://{self._address}/"
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._serve, args=(sockets,), name="liemech live scene", daemon=True
        )
        self._thread.start()
        atexit.register(self.close)
        if open:
            webbrowser.open(self.url)

    # ---------------------------------------------------------------- for the owner

    def display(self, state: State, t: float, run: int = 0) -> None:
        """Show a state of the scene's run number `run`.  t : its time, in s.  Takes microseconds,
        whoever looks.

        Raises InvalidInput for a scene that is closed, and if a state before this one could not be
        drawn.
        """
        if self._closed:
            raise InvalidInput("Live.display: this scene is closed")
        if not 0 <= run < len(self._scene.shown):
            raise InvalidInput(
                f"Live.display: run = {run}; the scene has {len(self._scene.shown)}, counted from 0"
            )
        if self._refused is not None:
            refused, self._refused = self._refused, None
            raise InvalidInput(
                f"Live.display: a state before this one could not be shown: {refused}"
            ) from refused
        with self._lock:
            self._states[run] = float(t), state
            if self._waiting:
                return
            self._waiting = True
        self._loop.call_soon_threadsafe(self._flush)

    def wait(self, timeout: float = 30.0) -> bool:
        """Wait until a page is open; False if none is after `timeout` seconds."""
        return self._seen.wait(timeout)

    def close(self) -> None:
        """End the page's connection and free the port; closing twice is once too often, and does no
        harm.
        """
        if self._closed:
            return
        self._closed = True
        atexit.unregister(self.close)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Live({self.url}{', closed' if self._closed else ''})"

    # ---------------------------------------------------------------- in the thread

    def _serve(self, sockets: list[Any]) -> None:
        """Serve the page until the loop is stopped."""
        asyncio.set_event_loop(self._loop)
        import tornado.httpserver
        import tornado.web
        import tornado.websocket

        live = self

        class Stream(tornado.websocket.WebSocketHandler):
            def open(self, *args: str, **kwargs: str) -> None:
                live._pages.add(self)
                live._seen.set()
                if live._states:
                    live._flush()

            def on_message(self, message: str | bytes) -> None:
                """Pages have nothing to say."""

            def on_close(self) -> None:
                live._pages.discard(self)

        class Document(tornado.web.RequestHandler):
            def get(self) -> None:
                from .page import page

                self.set_header("Cache-Control", "no-store")
                self.write(page(live._scene, False, f"ws://{live._address}/stream"))

        prefix = self._address.partition("/")[2]
        application = tornado.web.Application(log_function=lambda handler: None)
        routes: list[Any] = [(f"/{prefix}/", Document), (f"/{prefix}/stream", Stream)]
        # and not under a name that somebody else gave this address
        application.add_handlers(r"127\.0\.0\.1", routes)
        server = tornado.httpserver.HTTPServer(application)
        server.add_sockets(sockets)
        try:
            self._loop.run_forever()
        finally:
            server.stop()
            for page in list(self._pages):
                page.close()
            self._loop.run_until_complete(asyncio.sleep(0.05))  # for the goodbyes
            self._loop.run_until_complete(server.close_all_connections())
            self._loop.close()

    def _flush(self) -> None:
        """Send the last states to all pages; those that come meanwhile wait for the next picture."""
        with self._lock:
            self._waiting = False
        if not self._pages:
            return
        try:
            message = self._update()
        # of a content of the user's, or of numbers that are not finite: the next `display` tells
        except Exception as refused:
            self._refused = refused
            return
        for page in list(self._pages):
            page.write_message(message)
        with self._lock:
            self._waiting = True
        self._loop.call_later(1.0 / RATE, self._next)

    def _next(self) -> None:
        with self._lock:
            self._waiting = False
        if self._shown != self._states:
            self._flush()

    def _update(self) -> str:
        """The last states as they are drawn, in JSON."""
        with self._lock:
            states = self._shown = dict(self._states)
        nodes: dict[str, Any] = {}
        trails: dict[str, Any] = {}
        colors: dict[str, int] = {}
        for run, (t, state) in states.items():
            one = self._scene.shown[run]
            motion = Motion.moment(one.motion.system, t, state, one.motion.sites)
            for panel, content in self._scene.places(run):
                pen = Pen(self._panels[panel], f"run {run + 1}", one.color, run)
                content.draw(motion, pen)
                nodes |= {path: channels for path, channels in pen.nodes.items() if channels}
                trails |= pen.trails
                colors |= dict.fromkeys(pen.trails, number(one.color))
        latest = max(t for t, _ in states.values())
        return json.dumps(
            {"t": latest, "nodes": nodes, "trails": trails, "colors": colors}, allow_nan=False
        )
