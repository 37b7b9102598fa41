"""Chromium without a window, driven over a pipe: no port is opened, and it ends with the program
that started it.

Source: the Chrome DevTools Protocol, domains Target, Page, Runtime and Emulation.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from ..errors import BrowserFailure, MissingProgram

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

PATIENCE = 60.0
"""The longest time in s that an answer may take."""

FLAGS = (
    "--headless",
    "--remote-debugging-pipe",
    "--use-gl=angle",  # WebGL by software, which every machine has
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-sync",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--mute-audio",
    "--force-device-scale-factor=1",
)


def find() -> str | None:
    """The program, if this machine has it."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Chromium:
    """A browser of one's own; a context manager.  `open` gives a page.

    Raises MissingProgram where there is no Chromium, or no pipes to drive it by (Windows).
    """

    def __init__(self, size: tuple[int, int] = (1000, 560), flags: tuple[str, ...] = ()) -> None:
        program = find()
        if program is None or os.name != "posix":
            raise MissingProgram(
                "pictures of a scene are drawn by Chromium, which is not on the search path of "
                "this machine (Debian: apt-get install chromium). Scene.save writes the page "
                "without it; lm.plots draws with Matplotlib"
            )
        self.size, self.events = size, list[dict[str, Any]]()
        self._sent, self._unread = 0, b""
        self._profile = tempfile.mkdtemp(prefix="liemech-browser-")
        (near_in, self._to), (self._from, near_out) = os.pipe(), os.pipe()
        asroot = ("--no-sandbox",) if os.geteuid() == 0 else ()
        profile = f"--user-data-dir={self._profile}"
        # it reads file descriptor 3 and writes 4: the shell puts them there, whatever their numbers
        # are here; the later of two pipes is never 3
        wire = f'exec "$@" 3</dev/fd/{near_in} 4>/dev/fd/{near_out}'
        command = [program, *FLAGS, *asroot, *flags, profile, "about:blank"]
        nothing = subprocess.DEVNULL
        try:
            self._process = subprocess.Popen(
                ["/bin/sh", "-c", wire, "sh", *command],
                pass_fds=(near_in, near_out),
                stdin=nothing,
                stdout=nothing,
                stderr=nothing,
                start_new_session=True,
            )
        finally:
            os.close(near_in)
            os.close(near_out)

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the browser, and remove what it wrote."""
        if self._process.poll() is None:
            try:
                self.call("Browser.close", patience=5.0)
                self._process.wait(10)
            except (BrowserFailure, OSError, subprocess.TimeoutExpired):
                self._process.kill()
                self._process.wait()
        for end in (self._to, self._from):
            with contextlib.suppress(OSError):
                os.close(end)
        shutil.rmtree(self._profile, ignore_errors=True)

    def open(self, address: str | Path) -> Page:
        """A new page that has loaded this address or file."""
        return Page(self, address.resolve(strict=True).as_uri() if isinstance(address, Path) else address)

    def call(
        self, method: str, session: str | None = None, patience: float = PATIENCE, **parameters: Any
    ) -> dict[str, Any]:
        """Ask something of the browser, or of the page `session`, and wait for the answer."""
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        try:
            while data:
                data = data[os.write(self._to, data) :]
        except BrokenPipeError:
            raise BrowserFailure("the browser ended") from None
        until = time.monotonic() + patience
        while True:
            answer = self._next(until)
            if answer is None:
                raise BrowserFailure(f"{method}: no answer in {patience:g} s")
            if answer.get("id") != self._sent:
                self.events.append(answer)
            elif "error" in answer:
                raise BrowserFailure(f"{method}: {answer['error'].get('message')}")
            else:
                return answer["result"]

    def listen(self, seconds: float) -> None:
        """Let the pages run, and keep what they tell."""
        until = time.monotonic() + seconds
        while (event := self._next(until)) is not None:
            self.events.append(event)

    def _next(self, until: float) -> dict[str, Any] | None:
        """The next message, or None when the time is over."""
        while b"\0" not in self._unread:
            left = until - time.monotonic()
            if left <= 0.0 or not select.select([self._from], [], [], left)[0]:
                return None
            chunk = os.read(self._from, 1 << 20)
            if not chunk:
                raise BrowserFailure("the browser ended")
            self._unread += chunk
        message, _, self._unread = self._unread.partition(b"\0")
        return json.loads(message)


class Page:
    """A page in the browser."""

    def __init__(self, browser: Chromium, address: str) -> None:
        self.browser = browser
        self.target: str = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session: str = browser.call("Target.attachToTarget", targetId=self.target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(*browser.size)
        light = {
            "name": "prefers-color-scheme",
            "value": "light",
        }  # pictures are on white, whatever the machine prefers
        self.call("Emulation.setEmulatedMedia", features=[light])
        failed = self.call("Page.navigate", url=address).get("errorText")
        if failed:
            raise BrowserFailure(f"{address[:100]} does not open: {failed}")
        self.wait("document.readyState === 'complete'")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask something of this page."""
        return self.browser.call(method, self.session, **parameters)

    def resize(self, width: int, height: int) -> None:
        """Give the page another size, in pixels."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript; promises are waited for."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserFailure(details.get("exception", {}).get("description") or details["text"])
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = 30.0) -> None:
        """Wait until an expression of JavaScript is true."""
        until = time.monotonic() + seconds
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > until:
                raise BrowserFailure(f"not true after {seconds:g} s: {expression}")
            self.browser.listen(0.02)

    def picture(self) -> bytes:
        """The page as it looks now, as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """Close the page; the browser stays open."""
        self.browser.call("Target.closeTarget", targetId=self.target)
