"""Pictures of a scene, drawn by Chromium without a window: a PNG of one moment, a film of all of it."""

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
    scene: Scene, path: str | PathLike[str], t: float | None = None, *, size: tuple[int, int] = (1000, 560)
) -> Path:
    """Draw the scene at a time, by default the last, into a PNG file; needs Chromium.
    size : width and height in pixels.
    """
    file, since = file_that_ends(path, ".png"), scene.duration
    if t is not None:
        since = abs(t - scene.start)
        if since > scene.duration * (1.0 + 1e-9):
            raise InvalidInput(
                f"snapshot: t = {t:g} is outside the scene, {scene.duration:g} s from t = {scene.start:g}"
            )
    with _stage(scene, size) as page:
        file.write_bytes(_at(page, since))
    return file


def write_film(
    scene: Scene,
    path: str | PathLike[str],
    *,
    size: tuple[int, int] = (640, 360),
    fps: int = 20,
    seconds: float | None = None,
) -> Path:
    """Write the scene as a film, `fps` pictures for each of its seconds, each at its exact time: a
    .gif, for which Pillow is needed, or an .mp4 or .webm, for which the extra `film` is; needs Chromium.
    """
    file = file_that_ends(path, ".gif", ".mp4", ".webm")
    gif = file.suffix.lower() == ".gif"
    try:
        import PIL.Image as pillow

        if not gif:
            import imageio.v2 as films
    except ImportError as missing:
        what = "films need Pillow, and MP4 and WebM imageio with FFmpeg"
        raise MissingExtra(what, extra="film") from missing
    lasts = scene.seconds if seconds is None else seconds
    pictures = round(fps * lasts) + 1
    if fps < 1 or not 2 <= pictures <= MOST_PICTURES:
        raise InvalidInput(
            f"write_film: fps = {fps} for {lasts:g} s makes {pictures} pictures; wanted are 2 to {MOST_PICTURES}"
        )
    with _stage(scene, size) as page:
        shots = [
            pillow.open(io.BytesIO(_at(page, t))).convert("RGB") for t in np.linspace(0.0, scene.duration, pictures)
        ]
    if not gif:
        codec = "libvpx-vp9" if file.suffix.lower() == ".webm" else "libx264"
        films.mimwrite(file, shots, fps=fps, codec=codec, quality=8, macro_block_size=2)
        return file
    # one palette for all pictures, from some of them side by side
    sheet = pillow.fromarray(np.hstack([np.asarray(shot) for shot in shots[:: 1 + len(shots) // 6]]))
    palette = sheet.quantize(255, method=pillow.Quantize.MAXCOVERAGE)
    colors = np.array(palette.getpalette()).reshape(-1, 3)
    colors[colors.min(axis=1) > 244] = 255  # white is white
    palette.putpalette(colors.ravel().tolist())
    first, *others = (shot.quantize(palette=palette, dither=pillow.Dither.NONE) for shot in shots)
    first.save(file, save_all=True, append_images=others, duration=round(1000 / fps), loop=0)
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


def file_that_ends(path: str | PathLike[str], *endings: str) -> Path:
    """The path of a file, whose ending is one of these."""
    file = Path(path)
    if file.suffix.lower() not in endings:
        raise InvalidInput(f"the file must end in {' or '.join(endings)}; got {str(path)!r}")
    return file
