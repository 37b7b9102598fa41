"""Draw the pictures of the pages anew, of the main job and of every example that draws one, and
write the gallery.

    python docs/figures/draw.py [NAME ...]         # all of them, or only some; `gallery` alone draws nothing

Each program runs in an empty folder; its PNGs come here, with 256 colours, at a quarter of their
size. The pictures `work_precision` and `energy` are drawn from what those benchmarks measured last.
`film` makes the moving one, and needs Chromium as the photographs of pages do.
"""

import argparse
import ast
import contextlib
import importlib
import json
import os
import re
import runpy
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
WIDEST = 1600  # pixels
STRONG = 40  # between the largest and the smallest of red, green and blue, of 255
# the benchmarks with a picture, and where their files have its numbers
MEASURED = {"work_precision": "curves", "energy": "runs"}

SECTIONS = {
    "In motion": (
        *("flip_in_the_browser", "top_in_the_browser", "puma", "mixing_vorticity", "governor"),
        *("spins_in_the_browser", "rubber_rod", "bricard", "kapitza", "linkage_in_the_browser"),
        "ensemble_in_the_browser",
    ),
    "Bodies that turn freely": (
        *(
            "energy_drift",
            "tennis_racket",
            "poinsot",
            "ensemble",
            "order_of_methods",
            "three_rotations",
            "open_question",
        ),
        "kinds_of_generating_functions",
    ),
    "Tops and bodies of one's own": (
        "heavy_top",
        "gyrostat",
        "rotations_in_four_dimensions",
        "body_in_ten_dimensions",
        "heisenberg",
        "magnetic_moment",
    ),
    "Positions and momenta": (
        "pendulum_curves",
        "pendulums",
        "double_pendulum",
        "chaos_in_a_galaxy",
        "energy_exchange",
        "magnons",
        "kinks",
        "couplings",
    ),
    "Constraints, joints, rolling": ("index_reduction", "chain", "linkage", "arm", "net"),
    "Poisson systems, and steps that follow the motion": (
        "lotka_volterra",
        "banana_orbit",
        "eccentric_orbit",
    ),
    "Many bodies": ("binary_asteroid", "drop_of_water", "trefoil"),
    "At work": ("attitude_control", "slew", "flight", "rocket", "flight_code"),
    "Damping and noise": ("paramagnet", "relaxing_body"),
    "From measurements": ("fit_inertia", "fit_bodies", "attitude_filter"),
}
"""The examples as the gallery has them; those that are not here come at the end."""

HEAD = """# Gallery

One idea per example, in under forty lines; each ends with a number and a picture. Those that move
are pages of one file each: turn them with the mouse, press `?` for their keys, send them on.
"""
OUTPUTS = HERE / "outputs.json"
"""What each example printed when its picture was drawn; the site shows it below the code."""
STILLS = {
    "ensemble_in_the_browser": "cloud.png",
    "governor": "turning_governor.png",
    "linkage_in_the_browser": "rods.png",
    "mixing_vorticity": "eddies.png",
    "puma": "moving_puma.png",
    "spins_in_the_browser": "spins.png",
    "top_in_the_browser": "top.png",
}
"""Photographs of moving pages, by the example that writes the page."""
MOMENTS = {"governor": 0.44, "mixing_vorticity": 0.3, "puma": 0.8}
"""Where in the playing time they are taken, if not at 0.6 of it."""


def gallery(examples: list[str]) -> str:
    """The page: of every example the first sentence, and the pictures its code names, as far as
    they are drawn.
    """
    listed = {name for names in SECTIONS.values() for name in names}
    more = tuple(name for name in examples if name not in listed)
    text = HEAD
    for head, names in (SECTIONS | ({"More": more} if more else {})).items():
        text += f"\n## {head}\n\n"
        for name in (name for name in names if name in examples):
            code = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
            about = " ".join((ast.get_docstring(ast.parse(code)) or "").split("\n\n")[0].split())
            about = re.sub(r"docs/([\w/]+\.md)", r"[\1](\1)", about)
            about = re.sub(r"\bR\^(\w+)", r"$R^{\1}$", about)
            named = [STILLS[name]] if name in STILLS else re.findall(r'"(\w+\.png)"', code)
            pictures = [p for p in dict.fromkeys(named) if (HERE / p).exists()]
            shown = " ".join(f"![](figures/{p})" for p in pictures)
            # an item, so that the site can lay them out in a grid
            entry = f"* {shown} **[{name}](../examples/{name}.py)** {about}"
            # a link stays in one line
            text += textwrap.fill(
                entry, 100, break_long_words=False, break_on_hyphens=False, subsequent_indent="  "
            )
            text += "\n"
    return text


def reduced(image: Image.Image) -> Image.Image:
    """The picture with 256 colours: a share of them for the strong ones, which are few beside the
    shades of a sphere.
    """
    pixels = np.asarray(image).reshape(-1, 3)
    strong = pixels[np.ptp(pixels.astype(int), axis=1) > STRONG]
    shares = [(pixels, 191), (strong, 64)] if len(strong) else [(pixels, 255)]
    colors = [255, 255, 255]  # paper stays white
    for some, share in shares:
        part = Image.fromarray(some[None]).quantize(share, dither=Image.Dither.NONE)
        colors += (part.getpalette() or [])[: 3 * share]
    palette = Image.new("P", (1, 1))
    palette.putpalette(colors)
    found = np.array(image.quantize(palette=palette, dither=Image.Dither.NONE))
    # Pillow looks for neighbours in a coarse grid of colours
    found[(np.asarray(image) == 255).all(axis=2)] = 0
    picture = Image.frombytes("P", image.size, found.tobytes())
    picture.putpalette(colors)
    return picture


def program(*words: str) -> Callable[[str], None]:
    """What draws by running a program in a folder."""

    def draw(folder: str) -> None:
        paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        done = subprocess.run(
            [sys.executable, *words],
            cwd=folder,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": paths},
        )
        name = Path(words[-1]).stem
        if (ROOT / "examples" / f"{name}.py").exists():
            outputs = json.loads(OUTPUTS.read_text(encoding="utf-8")) if OUTPUTS.exists() else {}
            outputs[name] = done.stdout
            text = json.dumps(dict(sorted(outputs.items())), indent=1)
            OUTPUTS.write_text(text + "\n", encoding="utf-8")
        for page in Path(folder).glob("*.html"):
            if name in STILLS:
                photograph(page, Path(folder) / STILLS[name], MOMENTS.get(name, 0.6))

    return draw


def photograph(page: Path, picture: Path, moment: float) -> None:
    """A page at a part of its playing time, large enough for fine screens; nothing without Chromium."""
    from liemech.viewer.chromium import Chromium, find

    if find() is None:
        return
    with Chromium((1000, 460)) as browser:
        tab = browser.open(page)
        tab.wait("window.ready || window.failed")
        screen = {"width": 1000, "height": 460, "deviceScaleFactor": 2, "mobile": False}
        tab.call("Emulation.setDeviceMetricsOverride", **screen)
        tab.evaluate(f"player.bare(); seekTo({moment} * player.duration); player.draw()")
        picture.write_bytes(tab.picture())


def board(folder: str) -> None:
    """The ratios of the leader board, as they were measured last."""
    benchmarks = ROOT / "tests" / "benchmarks"
    sys.path[:0] = [str(ROOT), str(benchmarks)]
    numbers = json.loads((benchmarks / "leader_board.json").read_text(encoding="utf-8"))
    importlib.import_module("board_page").figure(numbers, Path(folder) / "leader_board.png")


def film(folder: str) -> None:
    """The first moving picture that a reader sees, in the documentation's first page."""
    program = runpy.run_path(str(ROOT / "examples" / "flip_in_the_browser.py"))
    program["scene"].write_film(HERE / "flip.gif", size=(480, 256), fps=7, seconds=5.0)


def measured(name: str) -> Callable[[str], None]:
    """What draws the numbers that a benchmark left."""

    def draw(folder: str) -> None:
        benchmarks = ROOT / "tests" / "benchmarks"
        sys.path[:0] = [str(ROOT), str(benchmarks)]
        numbers = json.loads((benchmarks / f"{name}.json").read_text(encoding="utf-8"))
        importlib.import_module(name).figure(numbers[MEASURED[name]], Path(folder) / f"{name}.png")

    return draw


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    examples = sorted((ROOT / "examples").glob("*.py"))
    makers = {"main_job": program("-m", "liemech")} | {
        path.stem: program(str(path)) for path in examples
    }
    makers |= {name: measured(name) for name in MEASURED}
    makers["film"] = film
    makers["leader_board"] = board
    makers["diagrams"] = program(str(HERE / "diagrams.py"))
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {', '.join(makers)}; all of them if left out"
    )
    wanted = parser.parse_args().names or list(makers)
    for name in wanted:
        if name == "gallery":
            continue
        if name not in makers:
            parser.error(f"{name!r} is neither gallery nor one of {', '.join(makers)}")
        with tempfile.TemporaryDirectory() as folder:
            with contextlib.chdir(folder):
                makers[name](folder)
            for picture in sorted(Path(folder).glob("*.png")):
                image = Image.open(picture).convert("RGB")
                image.thumbnail((WIDEST, WIDEST))
                reduced(image).save(HERE / picture.name, optimize=True)
                print(f"{picture.name}: {(HERE / picture.name).stat().st_size / 1e3:.0f} kB")
            for moving in sorted(Path(folder).glob("*.gif")):
                (HERE / moving.name).write_bytes(moving.read_bytes())
    (ROOT / "docs" / "gallery.md").write_text(
        gallery([path.stem for path in examples]), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
