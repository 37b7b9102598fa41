"""Pictures for LaTeX: Matplotlib's drawing commands for pgf, with labels that LaTeX takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..simulation.reports.written_tables import latex_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_pgf(figure: Figure, path: Path) -> None:
    """Write a figure as a pgfpicture.

    Matplotlib's own way asks LaTeX how wide texts are, leaves characters such as _ and # in labels,
    and numbers in commands that only its own preamble knows.  Here widths are those of Matplotlib's
    fonts, texts are escaped, and the file needs nothing but the package pgf.  Dots and shaded surfaces
    are in PNG files beside it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_mixed import MixedModeRenderer
    from matplotlib.backends.backend_pgf import RendererPgf

    measure: Any = FigureCanvasAgg(figure).get_renderer()

    class Renderer(RendererPgf):
        def draw_text(self, gc: Any, x: float, y: float, s: str, *rest: Any, **more: Any) -> None:
            super().draw_text(gc, x, y, latex_label(s), *rest, **more)

        def draw_image(self, gc: Any, x: float, y: float, im: Any, transform: Any = None) -> None:
            """Dots, in a PNG file beside, by pgf's own command."""
            from PIL import Image

            rows, columns = im.shape[:2]
            if not rows or not columns:
                return
            beside = path.with_name(f"{path.stem}-img{self.image_counter}.png")
            self.image_counter += 1
            Image.fromarray(im[::-1]).save(beside)
            inch = 1.0 / self.dpi
            a, b, c, d, dx, dy = (
                (columns, 0.0, 0.0, rows, 0.0, 0.0) if transform is None else transform.frozen().to_values()
            )
            file.write("\\begin{pgfscope}%\n")
            self._print_pgf_clip(gc)
            file.write(
                f"\\pgfsys@transformcm{{{a * inch:f}}}{{{b * inch:f}}}{{{c * inch:f}}}{{{d * inch:f}}}"
                f"{{{(dx + x) * inch:f}in}}{{{(dy + y) * inch:f}in}}%\n"
                "\\pgftext[left,bottom]{\\pgfimage[interpolate=true,width=1in,height=1in]"
                f"{{{beside.name}}}}}%\n\\end{{pgfscope}}%\n"
            )

        def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> Any:
            return measure.get_text_width_height_descent(s, prop, ismath)

    width, height = figure.get_size_inches()
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(
            "% \\input this file in a document with \\usepackage{pgf}\n"
            "\\begingroup%\n\\makeatletter%\n\\begin{pgfpicture}%\n"
            f"\\pgfpathrectangle{{\\pgfpointorigin}}{{\\pgfqpoint{{{width:f}in}}{{{height:f}in}}}}%\n"
            "\\pgfusepath{use as bounding box, clip}%\n"
        )
        figure.draw(
            MixedModeRenderer(figure, width, height, figure.dpi, Renderer(figure, file))  # type: ignore[arg-type]
        )
        file.write("\\end{pgfpicture}%\n\\makeatother%\n\\endgroup%\n")
