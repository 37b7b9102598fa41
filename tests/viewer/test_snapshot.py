"""Pictures of a scene: the right size, the right moment, nothing transparent."""

from __future__ import annotations

import functools
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from browser import Tab
from PIL import Image

import liemech as lm
from liemech.errors import InvalidInput, MissingProgram
from liemech.viewer import Scene, chromium
from liemech.viewer.chromium import Chromium

BODY = lm.RigidBody([1.0, 2.0, 3.0])


@functools.cache
def run() -> lm.Trajectory:
    """The motion that is seen."""
    start = BODY.state(mu=[0.3, 1.0, 0.2], g=np.eye(3))
    return lm.integrate(BODY, lm.RKMK(order=4), start, h=0.1, steps=100, compiled=False)


@pytest.mark.slow
def test_a_snapshot_is_the_moment_that_was_asked_for(browser: Chromium, tmp_path: Path) -> None:
    scene = Scene(run(), show="body")
    picture = np.asarray(Image.open(scene.snapshot(tmp_path / "two.png", 2.0, size=(320, 200))).convert("RGBA"))
    assert picture.shape[:2] == (200, 320)
    assert (picture[..., 3] == 255).all() and (picture[0, 0] == 255).all()
    with Tab.of(browser, scene.save(tmp_path / "body.html")) as tab:
        tab.resize(320, 200)
        tab.wait("window.ready")
        tab.evaluate("player.bare()")
        assert (tab.seek(2.0) == picture[..., :3]).all()
        assert (tab.seek(6.0) != picture[..., :3]).any()


@pytest.mark.slow
def test_a_gif_moves(browser: Chromium, tmp_path: Path) -> None:
    file = Scene(run(), show="momentum").write_film(tmp_path / "body.gif", size=(240, 160), fps=5, seconds=1.0)
    with Image.open(file) as movie:
        assert (movie.size, movie.n_frames) == ((240, 160), 6)
        frames = []
        for k in range(movie.n_frames):
            movie.seek(k)
            assert movie.info["duration"] == 200
            frames.append(np.asarray(movie.convert("RGB")).astype(int))
            assert (frames[-1][0, 0] == 255).all()
            red, green, blue = np.moveaxis(frames[-1], -1, 0)
            # the axes keep their colours, thin as they are
            assert (red - blue > 60).any() and (green - red > 30).any()
    assert all((a != b).any() for a, b in pairwise(frames))


@pytest.mark.slow
def test_what_cannot_be_drawn_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(run())
    with pytest.raises(InvalidInput, match=r"must end in \.png"):
        scene.snapshot(tmp_path / "a.jpg")
    with pytest.raises(InvalidInput, match="pictures; wanted are 2 to"):
        scene.write_film(tmp_path / "a.gif", fps=1000)
    monkeypatch.setattr(chromium, "find", lambda: None)
    with pytest.raises(MissingProgram, match="apt-get install chromium"):
        scene.snapshot(tmp_path / "a.png")


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_a_film_has_its_pictures(browser: Chromium, tmp_path: Path, ending: str) -> None:
    films = pytest.importorskip("imageio.v2", reason="needs the extra film")
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    file = Scene(run(), show="momentum").write_film(tmp_path / f"body.{ending}", size=(240, 160), fps=5, seconds=1.0)
    frames = [np.asarray(frame).astype(int) for frame in films.get_reader(file)]
    assert len(frames) == 6 and frames[0].shape == (160, 240, 3)
    assert all(np.abs(a - b).max() > 30 for a, b in pairwise(frames))
