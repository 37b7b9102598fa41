"""Draw the pictures of the pages anew: of the main job, and of every example that draws one.

    python docs/figures/draw.py [NAME ...]

Each program runs in an empty folder; its PNGs come here, with 256 colours, at a quarter of their size. Moving pictures and those of
the benchmarks are made elsewhere.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
WIDEST = 1600  # pixels
STRONG = 40  # between the largest and the smallest of red, green and blue, of 255


def reduced(image: Image.Image) -> Image.Image:
    """The picture with 256 colours: a share of them for the strong ones, which are few beside the shades of a sphere."""
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
    found[(np.asarray(image) == 255).all(axis=2)] = 0  # Pillow looks for neighbours in a coarse grid of colours
    picture = Image.frombytes("P", image.size, found.tobytes())
    picture.putpalette(colors)
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    examples = {path.stem: [str(path)] for path in sorted((ROOT / "examples").glob("*.py"))}
    programs = {"main_job": ["-m", "liemech"]} | examples
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(programs)}; all of them if left out")
    for name in parser.parse_args().names or programs:
        with tempfile.TemporaryDirectory() as folder:
            paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
            subprocess.run([sys.executable, *programs[name]], cwd=folder, check=True, env=os.environ | {"PYTHONPATH": paths})
            for picture in sorted(Path(folder).glob("*.png")):
                image = Image.open(picture).convert("RGB")
                image.thumbnail((WIDEST, WIDEST))
                reduced(image).save(HERE / picture.name, optimize=True)
                print(f"{picture.name}: {(HERE / picture.name).stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
