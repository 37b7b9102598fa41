"""Tables for papers, spreadsheets and notebooks: LaTeX, CSV and HTML, with texts that are shown as they are."""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Iterable
from typing import Any

from ...formulas.classes.frozen import frozen

SIGNS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
    "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", '"': r"\textquotedbl{}",
}  # fmt: skip
"""Characters that mean something else to LaTeX, or come out as another one."""

GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "varepsilon", "ζ": "zeta", "η": "eta",
    "θ": "theta", "\u03b9": "iota", "κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "π": "pi",
    "ρ": "rho", "σ": "sigma", "τ": "tau", "\u03c5": "upsilon", "φ": "varphi", "χ": "chi", "ψ": "psi",
    "ω": "omega", "Γ": "Gamma", "Δ": "Delta", "Θ": "Theta", "Λ": "Lambda", "Ξ": "Xi", "Π": "Pi",
    "Σ": "Sigma", "Φ": "Phi", "Ψ": "Psi", "Ω": "Omega",
}  # fmt: skip
SYMBOLS = GREEK | {
    "µ": "mu", "×": "times", "·": "cdot", "±": "pm", "≤": "leq", "≥": "geq", "≈": "approx", "→": "to",
    "∞": "infty", "√": "surd", "∂": "partial", "∇": "nabla", "°": "circ",
}  # fmt: skip


def latex(text: str) -> str:
    """A text as LaTeX prints it, outside of mathematics."""
    return "".join(SIGNS.get(c) or _symbol(c) for c in text)


def _symbol(c: str) -> str:
    if c == "\N{MINUS SIGN}":
        return r"\ensuremath{-}"
    if c == "°":
        return r"\ensuremath{^\circ}"
    return rf"\ensuremath{{\{SYMBOLS[c]}}}" if c in SYMBOLS else c


def latex_label(text: str) -> str:
    """A label as Matplotlib reads it, with mathematics between dollar signs, for LaTeX.

    Matplotlib's own commands become LaTeX's; a text with an odd number of dollar signs has no
    mathematics.
    """
    parts = re.split(r"(?<!\\)\$", text)
    if len(parts) % 2 == 0:
        return latex(text.replace(r"\$", "$"))
    words = [latex(part.replace(r"\$", "$")) for part in parts[::2]]
    maths = [f"${_maths(part)}$" for part in parts[1::2]]
    return "".join(x for pair in zip(words, [*maths, ""], strict=True) for x in pair)


def _maths(text: str) -> str:
    text = text.replace(r"\mathdefault", "").replace("\N{MINUS SIGN}", "-").replace("°", r"^\circ")
    return "".join(rf"\{SYMBOLS[c]} " if c in SYMBOLS else c for c in text)


def latex_number(x: float) -> str:
    """A number in three digits for LaTeX, with a power of ten where it is small or large."""
    if math.isnan(x):
        return "--"
    if math.isinf(x):
        return r"$\infty$" if x > 0 else r"$-\infty$"
    if x == 0.0 or 1e-2 <= abs(x) < 1e4:
        return f"${x:.3g}$" if abs(x) < 1e3 else f"${x:.4g}$"
    mantissa, exponent = f"{x:.2e}".split("e")
    return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$"


@frozen
class WrittenTable:
    """Rows of texts and numbers under headings."""

    headings: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """Comma-separated values, numbers with all their digits.  Returns the text, or writes it to a file."""
        text = io.StringIO()
        import csv  # here, for an import of runs does not wait for it

        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.headings)
        writer.writerows([[repr(float(x)) if _real(x) else x for x in row] for row in self.rows])
        return _out(text.getvalue(), path)

    def to_latex(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """A tabular for LaTeX that needs no package, numbers in three digits.  Returns the text, or
        writes it to a file.
        """
        sides = ["l" if any(isinstance(x, str) for x in column) else "r" for column in zip(*self.rows)]
        lines = [" & ".join([*map(latex, self.headings)])]
        lines += [" & ".join([latex_number(float(x)) if _real(x) else latex(str(x)) for x in row]) for row in self.rows]
        body = "\n".join(f"  {line} \\\\" for line in lines[1:])
        columns = "".join(sides) or "l" * len(self.headings)
        return _out(
            f"\\begin{{tabular}}{{{columns}}}\n  \\hline\n  {lines[0]} \\\\\n  \\hline\n{body}\n  \\hline\n"
            "\\end{tabular}\n",
            path,
        )


def html_table(about: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Rows of texts under headings, and a line above them, as a notebook shows them."""
    from html import escape

    def line(cells: Iterable[str], kind: str = "td") -> str:
        return "".join(["<tr>", *(f'<{kind} style="text-align:left">{escape(x)}</{kind}>' for x in cells), "</tr>"])

    return f"<div>{escape(about)}</div><table>{line(headings, 'th')}{''.join(map(line, rows))}</table>"


def _real(x: Any) -> bool:
    return isinstance(x, float)


def _out(text: str, path: str | os.PathLike[str] | None) -> str | None:
    if path is None:
        return text
    from pathlib import Path

    Path(path).write_text(text, encoding="utf-8", newline="")
    return None
