"""Pictures of a scene, drawn by Chromium without a window: a PNG of one moment, a GIF of all of it."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InvalidInput, MissingExtra
from .chromium import Chromium, Page

if TYPE_CHECKING:
    from .scene import Scene

MOST_PICTURES = 2000


def snapshot(
    scene: Scene, path: str | PathLike[str], t: float | None, size: tuple[int, int]
) -> Path:
    """The scene at a time, in a PNG file."""
    file = _file(path, ".png")
    with _stage(scene, size) as page:
        file.write_bytes(_at(page, scene.duration if t is None else _since(scene, t)))
    return file


def write_gif(
    scene: Scene, path: str | PathLike[str], size: tuple[int, int], fps: int, seconds: float | None
) -> Path:
    """The scene as a moving GIF: `fps` pictures for each second of its `seconds`, which are those
    of the scene by default.
    """
    file = _file(path, ".gif")
    try:
        from PIL import Image
    except ImportError as missing:
        raise MissingExtra("moving pictures need Pillow", extra="viewer") from missing
    lasts = scene.seconds if seconds is None else seconds
    pictures = round(fps * lasts) + 1
    if fps < 1 or not 2 <= pictures <= MOST_PICTURES:
        raise InvalidInput(
            f"write_gif: fps = {fps} for {lasts:g} s makes {pictures} "
            f"pictures; wanted are 2 to {MOST_PICTURES}"
        )
    with _stage(scene, size) as page:
        shots = [
            Image.open(io.BytesIO(_at(page, t))).convert("RGB")
            for t in np.linspace(0.0, scene.duration, pictures)
        ]
    # one palette for all pictures, from some of them side by side: white, the shades of large
    # areas, the colours of thin lines
    some = Image.fromarray(
        np.hstack([np.asarray(shot) for shot in shots[:: max(1, len(shots) // 6)]])
    )
    kinds = (Image.Quantize.MEDIANCUT, 96), (Image.Quantize.MAXCOVERAGE, 64)
    found = [
        (some.quantize(count, method=kind).getpalette() or [])[: 3 * count] for kind, count in kinds
    ]
    colours = np.concatenate(found).reshape(-1, 3)
    palette = Image.new("P", (1, 1))
    # nothing to be taken for white
    palette.putpalette([255, 255, 255, *colours[colours.min(axis=1) < 246].ravel().tolist()])
    frames = [shot.quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]
    frames[0].save(
        file,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 / fps),
        loop=0,
        optimize=False,
    )
    return file


@contextmanager
def _stage(scene: Scene, size: tuple[int, int]) -> Iterator[Page]:
    """The page of a scene, with nothing on it but the pictures."""
    width, height = size
    if not (64 <= width <= 8192 and 64 <= height <= 8192):
        raise InvalidInput(f"size is (width, height) in pixels, 64 to 8192; got {size!r}")
    with tempfile.TemporaryDirectory() as folder, Chromium((width, height)) as browser:
        page = browser.open(scene.save(Path(folder) / "scene.html"))
        page.wait("window.ready || window.failed")
        page.evaluate("player.bare()")
        yield page


def _at(page: Page, t: float) -> bytes:
    """The picture at a playing time."""
    page.evaluate(f"seekTo({float(t)!r}); player.draw()")
    return page.picture()


def _since(scene: Scene, t: float) -> float:
    since = abs(t - scene.start)
    if since > scene.duration * (1.0 + 1e-9):
        raise InvalidInput(
            f"snapshot: t = {t:g} is outside the scene, "
            f"{scene.duration:g} s from t = {scene.start:g}"
        )
    return since


def _file(path: str | PathLike[str], ending: str) -> Path:
    file = Path(path)
    if file.suffix.lower() != ending:
        raise InvalidInput(f"the file must end in {ending}; got {str(path)!r}")
    return file
