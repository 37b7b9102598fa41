"""States shown as they come: a page on this machine, fed by a thread of this process."""

from __future__ import annotations

import asyncio
import atexit
import json
import secrets
import threading
import webbrowser
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import InvalidInput, MissingExtra
from ..systems.system import State
from .drawing import SHARED, Drawing
from .motion import Motion
from .page import page
from .shapes import number

if TYPE_CHECKING:
    from .scene import Scene

RATE = 60.0
"""Pictures a second, at most: of states that come faster the last one is shown."""


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
            raise MissingExtra("a live scene needs tornado, which comes with meshcat", extra="viewer") from missing
        self._scene, self._panels = scene, {panel.path: panel for panel in scene.panels()}
        self._states: dict[int, tuple[float, State]] = {}
        self._pages: set[Any] = set()
        self._closed, self._seen = False, threading.Event()
        self._refused: Exception | None = None
        self._shown: dict[int, tuple[float, State]] | None = None
        sockets = bind_sockets(0, "127.0.0.1")
        # unknown to others on this machine
        self._address = f"127.0.0.1:{sockets[0].getsockname()[1]}/{secrets.token_urlsafe(9)}"
        self.url = f"http://{self._address}/"
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, args=(sockets,), name="liemech live scene", daemon=True)
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
            raise InvalidInput(f"Live.display: run = {run}; the scene has {len(self._scene.shown)}, counted from 0")
        if self._refused is not None:
            refused, self._refused = self._refused, None
            raise InvalidInput(f"Live.display: a state before this one could not be shown: {refused}") from refused
        self._states = self._states | {run: (float(t), state)}

    def wait(self, timeout: float = 30.0) -> bool:
        """Wait until a page is open; False if none is after `timeout` seconds."""
        return self._seen.wait(timeout)

    def close(self) -> None:
        """End the page's connection and free the port; closing twice is once too often, and does no harm."""
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

        class StateStream(tornado.websocket.WebSocketHandler):
            def open(self, *args: str, **kwargs: str) -> None:
                live._pages.add(self)
                live._seen.set()
                live._shown = None

            def on_message(self, message: str | bytes) -> None:
                """Pages have nothing to say."""

            def on_close(self) -> None:
                live._pages.discard(self)

        class Document(tornado.web.RequestHandler):
            def get(self) -> None:
                self.set_header("Cache-Control", "no-store")
                self.write(page(live._scene, socket=f"ws://{live._address}/stream"))

        prefix = self._address.partition("/")[2]
        application = tornado.web.Application(log_function=lambda handler: None)
        routes: list[Any] = [(f"/{prefix}/", Document), (f"/{prefix}/stream", StateStream)]
        # and not under a name that somebody else gave this address
        application.add_handlers(r"127\.0\.0\.1", routes)
        server = tornado.httpserver.HTTPServer(application)
        server.add_sockets(sockets)
        self._send()
        try:
            self._loop.run_forever()
        finally:
            server.stop()
            for reader in list(self._pages):
                reader.close()
            self._loop.run_until_complete(asyncio.sleep(0.05))  # for the goodbyes
            self._loop.run_until_complete(server.close_all_connections())
            self._loop.close()

    def _send(self) -> None:
        """Send the last states to all pages if they, or a page, are new; again for the next picture."""
        self._loop.call_later(1.0 / RATE, self._send)
        states = self._states
        if not self._pages or not states or states is self._shown:
            return
        self._shown = states
        try:
            message = self._update(states)
        # of a content of the user's, or of numbers that are not finite: the next `display` tells
        except Exception as refused:
            self._refused = refused
            return
        for reader in list(self._pages):
            reader.write_message(message)

    def _update(self, states: dict[int, tuple[float, State]]) -> str:
        """The last states as they are drawn, in JSON."""
        nodes: dict[str, Any] = {}
        trails: dict[str, Any] = {}
        colors: dict[str, int] = {}
        for run, (t, state) in states.items():
            shown, name = self._scene.shown[run], f"run {run + 1}"
            motion = Motion.moment(shown.motion.system, t, state, shown.motion.sites)
            for path, content in self._scene.places(run):
                panel = self._panels[path]
                shared = {p: node for p, node in panel.nodes.items() if f"/{SHARED}/" in p}
                now = replace(panel, nodes=dict(shared), tips={})
                content.draw(motion, Drawing(now, name, shown.color, run))
                for p, (point, color) in now.tips.items():
                    trails[p], colors[p] = [point.tolist()], number(color)
                for p, node in now.nodes.items():
                    if p not in shared and node.still:
                        nodes[p] = {c: rows.ravel().tolist() for c, rows in node.still.items()}
        latest = max(t for t, _ in states.values())
        return json.dumps({"t": latest, "nodes": nodes, "trails": trails, "colors": colors}, allow_nan=False)
