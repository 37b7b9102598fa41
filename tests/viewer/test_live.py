"""Live scenes: local, harmless, and up to date."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import textwrap
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import Tab, waited

import liemech as lm
from liemech.errors import InvalidInput
from liemech.viewer import live
from liemech.viewer.chromium import Chromium

pytest.importorskip("tornado", reason="needs tornado, which comes with meshcat (the extra viewer)")
pytest.importorskip("meshcat", reason="needs meshcat's page (the extra viewer)")

BODY = lm.RigidBody([1.0, 2.0, 3.0])
START = BODY.state(mu=[0.3, 1.0, 0.2], g=np.eye(3))
METHOD = lm.RKMK(order=4)


def answer(url: str, headers: dict[str, str]) -> str:
    """The first line of what the server says to a request with these headers."""
    place = urlsplit(url)
    assert place.hostname and place.port
    head = {"Host": f"{place.hostname}:{place.port}"} | headers
    with socket.create_connection((place.hostname, place.port), timeout=10) as line:
        text = "".join(f"{name}: {value}\r\n" for name, value in head.items())
        line.sendall(f"GET {place.path} HTTP/1.1\r\n{text}\r\n".encode())
        return line.recv(4096).decode(errors="replace").partition("\r\n")[0]


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "MDEyMzQ1Njc4OTAxMjM0NQ==",
    "Sec-WebSocket-Version": "13",
}


def test_it_listens_to_this_machine_alone() -> None:
    with live(BODY, START, open=False) as one, live(BODY, START, open=False) as two:
        ports = [urlsplit(view.url).port for view in (one, two)]
        assert ports[0] != ports[1]
        if os.path.exists("/proc/net/tcp"):
            tables = [file for name in ("tcp", "tcp6") if (file := Path(f"/proc/net/{name}")).exists()]
            table = [row.split() for file in tables for row in file.read_text().splitlines()[1:]]
            ours = [row[1] for row in table if row[3] == "0A" and int(row[1].rpartition(":")[2], 16) in ports]
            assert ours and all(address.startswith("0100007F:") for address in ours)  # 127.0.0.1
        assert "200" in answer(one.url, {})
        # a name that somebody gave to 127.0.0.1
        assert "404" in answer(one.url, {"Host": "evil.example"})
        # without the word that only the owner knows
        assert "404" in answer(f"http://127.0.0.1:{ports[0]}/", {})
        stream = one.url + "stream"
        assert "101" in answer(stream, UPGRADE | {"Origin": f"http://127.0.0.1:{ports[0]}"})
        assert "403" in answer(stream, UPGRADE | {"Origin": "http://evil.example"})
    for port in ports:
        with pytest.raises(OSError, match=r"."):
            socket.create_connection(("127.0.0.1", port), timeout=2)
    one.close()
    with pytest.raises(InvalidInput, match="closed"):
        one.display(START, 0.0)


def test_nobody_looks() -> None:
    with live(BODY, START, "momentum", open=False) as view:
        for n in range(10_000):
            view.display(START, 0.1 * n)
        # the last state, and no queue of the others
        assert view._states == {0: (pytest.approx(999.9), START)}
        assert not view.wait(timeout=0.05)
        with pytest.raises(InvalidInput, match="run = 1"):
            view.display(START, 0.0, run=1)


ENDS = "os.kill(os.getpid(), 9)", "os.kill(os.getpid(), 15)", "sys.exit(0)"


@pytest.mark.slow
def test_nothing_is_left_behind() -> None:
    program = """
        import os, sys, numpy as np, liemech as lm
        body = lm.RigidBody([1.0, 2.0, 3.0])
        view = lm.viewer.live(body, body.state(mu=[0.3, 1.0, 0.2]), open=False)
        children = "/proc/self/task/%d/children" % os.getpid()
        print(view.url, open(children).read().strip() if os.path.exists(children) else "", flush=True)
    """
    programs = [[sys.executable, "-c", textwrap.dedent(program) + end] for end in ENDS]
    for running in [
        subprocess.Popen(p, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) for p in programs
    ]:
        url, _, children = running.communicate(timeout=60)[0].strip().partition(" ")
        assert not children  # one process, one thread more: whatever ends it ends all
        port = urlsplit(url).port
        assert port
        with pytest.raises(OSError, match=r"."):
            socket.create_connection(("127.0.0.1", port), timeout=2)


@pytest.mark.slow
def test_a_page_shows_the_last_state(browser: Chromium) -> None:
    arrow = "new MeshCat.THREE.Vector3(0, 0, 1).applyQuaternion(object.quaternion).toArray()"
    state, h = START, 0.1
    with live(BODY, START, ("body", "momentum"), open=False) as view, Tab.of(browser, view.url) as tab:
        tab.wait("window.ready")
        assert view.wait(10.0)
        for n in range(30):
            state = METHOD.step(BODY, n * h, state, h)
            view.display(state, (n + 1) * h)
        now = "t = 3.00000 s"
        tab.wait(f"document.getElementById('label').textContent === {now!r}")
        direction = np.array(state.mu) / np.linalg.norm(state.mu)
        assert np.abs(tab.read("panel 2/run 1/mu", [0.0], arrow)[0] - direction).max() < 1e-6
        assert tab.complaints() == []
        view.display(lm.BodyState(np.array([1.0, np.nan, 0.0]), np.eye(3)), 3.0)
        assert waited(lambda: view._refused is not None)
        with pytest.raises(InvalidInput, match="a state before this one could not be shown"):
            view.display(state, 3.0)
        view.display(state, 3.0)
        tab.call("Page.reload")
        tab.wait(f"window.ready && document.getElementById('label').textContent === {now!r}")
        assert np.abs(tab.read("panel 2/run 1/mu", [0.0], arrow)[0] - direction).max() < 1e-6
    assert waited(lambda: not view._thread.is_alive())
