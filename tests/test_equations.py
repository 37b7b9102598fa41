"""The tables of equations are true: every number of both sources is there once, in order, with what
stands under this number; what a row names is there, and so are the tests that hold it.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from liemech.names import everything

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "proof" / "equations.md").read_text(encoding="utf-8")
FOLDERS = {"The article": "", "Constrained systems": "constrained", "Poisson systems": "poisson", "Time": "timing"}

NUMBERS = {
    "The article": [f"({k})" for k in range(1, 16)],
    "Constrained systems": [f"(1.{k})" for k in range(1, 17)],
    "Poisson systems": [f"(2.{k})" for k in range(1, 23)],
    "Time": [f"(3.{k})" for k in range(1, 12)],
}
"""The equations that the article and the slides number, section by section."""

UNDER = {
    "(1)": r"\dot Y = A(t, Y)",
    "(2)": r"\dot\Omega =",
    "(3)": r"\dot\pi = A(\pi)",
    "(4)": r"(2) for (3)",
    "(5)": r"g_{i+1} = g_i\,\tau(h\xi_i)",
    "(6)": "momentum of a discrete Lagrangian",
    "(7)": r"\mu_i = \mathrm{Ad}^*",
    "(8)": r"K = H + \partial_t G",
    "(9)": "Hamilton-Jacobi equation",
    "(10)": r"\sum t^m G_m/m!",
    "(11)": r"\mathrm d\bar S_t =",
    "(12)": r"H = K + \partial_t\bar S_t",
    "(13)": "Lie-Poisson Hamilton-Jacobi equation",
    "(14)": r"\pi_0 = R_g^*",
    "(15)": r"\pi_1 = \mathrm{Ad}^*_g",
    "(1.1)": "L = T - U",
    "(1.2)": r"\frac{\partial L}{\partial\dot q}",
    "(1.3)": r"M\dot v = f - G^T\lambda",
    "(1.4)": "0 = G v",
    "(1.5)": "linear system",
    "(1.6)": r"\dot v = \dot v(q, v)",
    "(1.7)": r"\mathcal Q",
    "(1.8)": r"\dot p = -H_q - G^T\lambda",
    "(1.9)": r"\lambda = (G H_{pp} G^T)^{-1}",
    "(1.10)": r"\mathcal M = ",
    "(1.11)": "symplectic Euler",
    "(1.12)": "projection",
    "(1.13)": "RATTLE",
    "(1.14)": "G H_p^{[i]} = 0",
    "(1.15)": r"-H_q^{[i]} - G^T\lambda",
    "(1.16)": "H = T + U",
    "(2.1)": "f^{[1]}(y) + f^{[2]}(y)",
    "(2.2)": "Lie derivative",
    "(2.3)": r"F_{q_i} H_{p_i} - F_{p_i} H_{q_i}",
    "(2.4)": "canonical bracket",
    "(2.5)": r"F = \{F, H\}",
    "(2.6)": r"\{I, H\} = 0",
    "(2.7)": r"\dot y_i = \{y_i, H\}",
    "(2.8)": r"b_{ij}(y)\,G_j",
    "(2.9)": "b_{ij} = -b_{ji}",
    "(2.10)": "Jacobi",
    "(2.11)": r"\lambda_i\nabla g_i",
    "(2.12)": r"\mathcal M",
    "(2.13)": r"x = \mathcal X(y)",
    "(2.14)": r"X\dot y",
    "(2.15)": r"X^T J X\,\dot y",
    "(2.16)": r"\dot y = B\,\nabla K",
    "(2.17)": "Darboux and Lie",
    "(2.18)": r"\dot c = 0",
    "(2.19)": r"\dot y = B(y)\,\nabla H(y)",
    "(2.20)": "a Poisson map",
    "(2.21)": "a symplectic map",
    "(2.22)": "a Casimir",
    "(3.1)": r"y' = \sigma(y) f(y)",
    "(3.2)": r"K = \sigma\,(H - H_0)",
    "(3.3)": r"J^{-1}\nabla\sigma",
    "(3.4)": r"\sigma(\rho y) = \sigma(y)",
    "(3.5)": r"z\,\sigma(y) = 1",
    "(3.6)": r"z'\sigma + z\,\nabla\sigma^T y' = 0",
    "(3.7)": r"z' = -\nabla\sigma^T f/\sigma",
    "(3.8)": r"\Phi_{\varepsilon/z}",
    "(3.9)": "Störmer and Verlet",
    "(3.10)": r"f^{[\mathrm{fast}]} + f^{[\mathrm{slow}]}",
    "(3.11)": r"(\Phi^{[\mathrm{fast}]}_{h/N})^N",
}
"""What the sources print under a number, as the second column of its row has it."""


def rows(head: str) -> list[list[str]]:
    """The rows of a section, cell by cell."""
    section = PAGE.partition(f"## {head}\n")[2].partition("\n## ")[0]
    found = [
        [cell.strip() for cell in row.strip("|").split("|")]
        for row in section.splitlines()
        if row.startswith("| ") and not row.startswith(("| equation", "| ---"))
    ]
    assert all(len(row) == 5 for row in found), [row for row in found if len(row) != 5]
    return found


@pytest.mark.parametrize("head", NUMBERS)
def test_every_number_is_a_row_once_and_in_order(head: str) -> None:
    named = [row[0] for row in rows(head) if re.fullmatch(r"\(\d+(\.\d+)?\)", row[0])]
    assert named == NUMBERS[head]


@pytest.mark.parametrize("head", NUMBERS)
def test_a_number_stands_for_what_the_sources_print_under_it(head: str) -> None:
    for number, says, *_ in rows(head):
        if number in NUMBERS[head]:
            assert UNDER[number] in says, number


@pytest.mark.parametrize("head", FOLDERS)
def test_every_equation_names_a_test_that_is_there(head: str) -> None:
    for row in rows(head):
        names = re.findall(r"`(?:([\w/]+\.py)::)?(test_\w+)`", row[3])
        assert names, f"no test: {row}"
        for path, name in names:
            files = [ROOT / "tests" / path] if path else sorted((ROOT / "tests" / FOLDERS[head]).glob("test_*.py"))
            assert path or FOLDERS[head], f"{name}: which file?"
            code = "".join(file.read_text(encoding="utf-8") for file in files)
            assert f"def {name}(" in code, f"{name} is not in {files}"


def test_classes_and_functions_of_the_table_are_there() -> None:
    for head in FOLDERS:
        for row in rows(head):
            assert "`" in row[2], f"nothing of the library: {row}"
            for name in re.findall(r"`([A-Z]\w+)(?:\.(\w+))?`", row[2]):
                thing = everything()[name[0]]
                assert not name[1] or name[1] in dir(thing), name


def test_numbers_in_docstrings_are_those_of_the_tables() -> None:
    """A docstring that cites an equation of the slides or of the article cites one that there is."""
    known = {number for numbers in NUMBERS.values() for number in numbers}
    cited = 0
    for file in sorted((ROOT / "liemech").rglob("*.py")):
        text = " ".join(file.read_text(encoding="utf-8").split())
        for which in re.findall(r"the (?:slides|article), ((?:(?:, | and )?\([\d.]+\))+)", text):
            for number in re.findall(r"\([\d.]+\)", which):
                cited += 1
                assert number in known, f"{file.name}: {number}"
    assert cited > 5
