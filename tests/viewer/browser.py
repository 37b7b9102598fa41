"""A page under test: a real browser, real mouse and keys, and a record of everything it complained about or asked for."""

from __future__ import annotations

import io
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from PIL import Image

from liemech.viewer.chromium import Chromium, Page

HERE = ("127.0.0.1", "localhost", "::1")


class Tab(Page):
    """A page with hands and eyes."""

    @classmethod
    def of(cls, browser: Chromium, address: str | Path) -> Tab:
        return cls(browser, address.resolve(strict=True).as_uri() if isinstance(address, Path) else address)

    def __enter__(self) -> Tab:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # ------------------------------------------------------------ eyes

    def pixels(self) -> np.ndarray:
        """What is to be seen, (height, width, 3)."""
        return np.asarray(Image.open(io.BytesIO(self.picture())).convert("RGB")).astype(int)

    def drawn(self) -> np.ndarray:
        """What is to be seen when the page has been painted again."""
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return self.pixels()

    def seek(self, t: float) -> np.ndarray:
        """The picture at a playing time."""
        self.evaluate(f"seekTo({float(t)!r})")
        return self.drawn()

    def complaints(self) -> list[str]:
        """Errors on the console, exceptions nobody caught, and requests that leave the machine."""
        found = []
        for event in self.browser.events:
            if event.get("sessionId") != self.session:
                continue
            what, about = event["method"], event["params"]
            if what == "Runtime.consoleAPICalled" and about["type"] in ("error", "assert"):
                found.append(f"console: {[a.get('value', a.get('description')) for a in about['args']]}")
            elif what == "Runtime.exceptionThrown":
                found.append(f"exception: {about['exceptionDetails']}")
            elif what == "Log.entryAdded" and about["entry"]["level"] == "error":
                found.append(f"log: {about['entry']['text']}")
            elif what == "Network.requestWillBeSent":
                address = urlsplit(about["request"]["url"])
                if address.scheme in ("http", "https", "ws", "wss") and address.hostname not in HERE:
                    found.append(f"request: {about['request']['url'][:200]}")
        return found

    # ------------------------------------------------------------ hands

    def click(self, selector: str, across: float = 0.5) -> None:
        """Click an element, at this part of its width."""
        left, top, width, height = self.evaluate(
            f"(() => {{ const r = document.querySelector({selector!r}).getBoundingClientRect();"
            " return [r.x, r.y, r.width, r.height]; })()"
        )
        self._mouse("mousePressed", left + across * width, top + 0.5 * height)
        self._mouse("mouseReleased", left + across * width, top + 0.5 * height)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Pull from one place to another with the left button."""
        self._mouse("mousePressed", *start)
        for share in np.linspace(0.0, 1.0, 6)[1:]:
            self._mouse("mouseMoved", *(a + share * (b - a) for a, b in zip(start, end, strict=True)))
        self._mouse("mouseReleased", *end)

    def press(self, key: str) -> None:
        """A key, as KeyboardEvent names it."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def _mouse(self, kind: str, x: float, y: float) -> None:
        held = {"buttons": 1} if kind != "mouseReleased" else {}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1, **held)

    # ------------------------------------------------------------ what the page knows

    def read(self, path: str, times: Any, value: str) -> np.ndarray:
        """A value of JavaScript, made from the `object` of a node, at many times: (n, ...)."""
        program = f"""(times => {{
            const found = player.viewer.scene_tree.find({path!r}.split("/"));
            const object = found.object, inner = found.children["<object>"] && found.children["<object>"].object;
            return times.map(t => {{ seekTo(t); return {value}; }});
        }})({np.asarray(times).tolist()})"""
        return np.array(self.evaluate(program), dtype=float)

    def has(self, path: str) -> bool:
        """Is there a node at this path?  Looks without making one."""
        steps = path.split("/")
        return bool(
            self.evaluate(f"{steps!r}.reduce((n, s) => n && n.children[s], player.viewer.scene_tree) !== undefined")
        )


def waited(condition: Any, seconds: float = 10.0) -> bool:
    """Does it become true in time?"""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True
