"""Tables and pictures for papers: CSV that reads back, LaTeX that compiles, orders that are measured."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import liemech as lm
from liemech.rooms.at_work.measured_orders import order_of
from liemech.simulation.reports.written_tables import WrittenTable, html_table, latex, latex_label, latex_number

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state([0.5, 0.0, 0.75**0.5], np.eye(3))
HARD = "a_b 50% & #1 {x} ~^\\ < > | µ °"
ESCAPED = (
    r"a\_b 50\% \& \#1 \{x\} \textasciitilde{}\textasciicircum{}\textbackslash{} \textless{} "
    r"\textgreater{} \textbar{} \ensuremath{\mu} \ensuremath{^\circ}"
)


def bare_specials(text: str) -> list[str]:
    """Characters outside of mathematics that LaTeX would take for commands of its own."""
    outside = re.sub(r"(?<!\\)\$.*?(?<!\\)\$", "", text)
    outside = re.sub(r"\\ensuremath\{.*?\}+|\\[a-zA-Z]+(\{\})?|\\[&%$#_{}]", "", outside)
    return re.findall(r"[&%$#_^~\\|<>]", outside)


def test_what_latex_reads_otherwise_is_escaped() -> None:
    assert latex(HARD) == ESCAPED and not bare_specials(latex(HARD))
    assert latex_label("error of $\\mu^2_1$ in %") == "error of $\\mu^2_1$ in \\%"
    assert latex_label("costs 5$") == "costs 5\\$"  # no mathematics in one dollar
    assert latex_label("$\\mathdefault{10^{−3}}$") == "${10^{-3}}$"
    assert latex_label(r"\$5 of $x$_1") == r"\$5 of $x$\_1"
    assert [*map(latex_number, (0.0, 12.345, 1.5e-12, -3e20, np.inf, np.nan))] == [
        "$0$", "$12.3$", r"$1.50\cdot 10^{-12}$", r"$-3.00\cdot 10^{20}$", r"$\infty$", "--",
    ]  # fmt: skip


def test_the_report_of_a_run_as_a_table(tmp_path: Path) -> None:
    drift = lm.integrate(BODY, lm.RKMK(order=4), START, h=0.1, steps=50).drift()
    text = drift.to_csv()
    assert text is not None
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["constant"] for row in rows] == [*drift]
    for row in rows:  # to the last digit
        kept = drift[row["constant"]]
        assert float(row["largest change"]) == kept.largest and row["verdict"] == kept.verdict
        assert float(row["slope"]) == kept.slope and float(row["relative to"]) == kept.scale
    assert drift.to_csv(tmp_path / "drift.csv") is None
    assert (tmp_path / "drift.csv").read_bytes().decode() == text
    table = drift.to_latex()
    assert table is not None and table.count("\\\\\n") == len(drift) + 1
    assert table.startswith("\\begin{tabular}{llrrr}\n") and table.endswith("\\end{tabular}\n")


def rows_in_notebook(shown: object) -> tuple[str, list[list[str]]]:
    """The line and the cells that a notebook shows of an object."""
    about, table = ElementTree.fromstring(f"<div>{shown._repr_html_()}</div>")  # type: ignore[attr-defined]
    return about.text or "", [[cell.text or "" for cell in row] for row in table]


@pytest.mark.slow
def test_runs_and_reports_are_tables_in_notebooks() -> None:
    run = lm.integrate(BODY, lm.RKMK(order=4), START, h=0.1, steps=50)
    about, (_, t, mu, g) = rows_in_notebook(run)
    assert about == repr(run)
    assert (t[:2], mu[:2], g[:2]) == (["t", "(51,)"], ["mu", "(51, 3)"], ["g", "(51, 3, 3)"])
    assert t[2] == "0 ... 5" and [float(x) for x in mu[2].split(" ... ")] == pytest.approx(
        [run.mu.min(), run.mu.max()], 1e-5
    )
    _, rows = rows_in_notebook(run.drift())
    for name, cells in zip(run.drift(), rows[1:], strict=True):
        kept = run.drift()[name]
        assert cells[:2] == [name, kept.verdict] and float(cells[2]) == pytest.approx(kept.largest, rel=0.05)
    for report in (lm.check_group(lm.SO3()), lm.check_method(lm.RKMK(order=2), BODY, START)):
        about, rows = rows_in_notebook(report)
        assert about == report.verdict
        assert [row[:2] for row in rows[1:]] == [[f.law, f.verdict] for f in report.findings]
        assert {len(row) for row in rows} == {len(rows[0])}


def test_names_with_every_sign_in_tables() -> None:
    table = WrittenTable((HARD, "x"), (('with "quotes", commas\nand lines', 1.0), (HARD, float("nan"))))
    text, tabular = table.to_csv(), table.to_latex()
    assert text is not None and tabular is not None
    read = list(csv.reader(io.StringIO(text)))
    assert read[0][0] == HARD and read[1] == ['with "quotes", commas\nand lines', "1.0"]
    assert tabular.count(ESCAPED) == 2 and "{lr}" in tabular
    (about, shown) = ElementTree.fromstring(f"<div>{html_table(HARD, (HARD,), [(HARD,)])}</div>")
    assert about.text == HARD and [cell.text for row in shown for cell in row] == [HARD, HARD]


@pytest.mark.slow
def test_orders_are_measured(tmp_path: Path) -> None:
    """Against the exact body, and against a reference where there is none."""
    methods = {"two": lm.RKMK(order=2), "four_4": lm.RKMK(order=4)}
    found = lm.measure_order(BODY, methods, START, 2.0, steps=(64, 8, 16, 32), compiled=False)
    assert found["two"].order == pytest.approx(2.0, abs=0.1)
    assert found["four_4"].order == pytest.approx(4.0, abs=0.2)
    exact = BODY.exact(START, 2.0)
    run = lm.integrate(BODY, methods["two"], START, h=0.25, steps=8, compiled=False)
    expected = max(
        np.abs(run.mu[-1] - exact.mu).max() / np.abs(exact.mu).max(),
        np.abs(run.g[-1] - exact.g).max() / np.abs(exact.g).max(),
    )
    assert found["two"].errors[0] == pytest.approx(expected, rel=1e-12)
    text, tabular = found.to_csv(), found.to_latex()
    assert text is not None and tabular is not None
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 8 and float(rows[5]["order"]) == pytest.approx(
        np.log2(found["four_4"].errors[0] / found["four_4"].errors[1])
    )
    assert "four\\_4" in tabular and "four_4" in str(found)
    assert set(found.work) == set(found.errors) == set(methods)
    assert all((seconds > 0.0).all() for _, seconds in found.work.values())
    weight = lm.models.FixedPointGravity(0.3, [0.0, 0.1, 1.0])
    top = lm.MechanicalSystem(BODY, weight)
    begin = top.state(START.mu, START.g)
    one = lm.measure_order(top, lm.LieVerlet(), begin, 1.0, steps=(10, 20), compiled=False)
    assert float(one) == pytest.approx(2.0, abs=0.1)
    with pytest.raises(lm.errors.InvalidInput, match="not one order"):
        float(found)
    for bad, told in (
        ({"methods": [3.0]}, "is no method"), ({"methods": []}, "needs a method"), ({"steps": [8]}, "two numbers"),
        ({"t_end": -1.0}, "t_end must be positive"), ({"start": BODY.state([[1.0, 0, 0]] * 2)}, "one body"),
    ):  # fmt: skip
        given = {"methods": methods, "start": START, "t_end": 1.0} | bad
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=told):
            lm.measure_order(BODY, **given)  # type: ignore[arg-type]


def test_the_order_is_told_above_the_floor_of_rounding() -> None:
    h = np.array([0.1, 0.05, 0.025, 0.0125])
    assert order_of(h, np.maximum(h**4, 0.025**4)) == pytest.approx(4.0)
    assert order_of(h, np.zeros(4)) is None


@pytest.mark.slow
def test_labels_of_pgf_pictures_survive_latex(tmp_path: Path) -> None:
    """Without LaTeX: no bare _ or #, no command of Matplotlib's own preamble, balanced braces."""
    pytest.importorskip("matplotlib")
    steps, path = np.array([0.1, 0.05, 0.025]), tmp_path / "orders.pgf"
    curves = {HARD: steps**2, "$\\tau^2$ in %": steps**4, "Störmer_1": steps**3}
    ax = lm.plots.orders(steps, curves, title="100 % of $h$ − 5_µm")
    for _ in range(2):  # the same figure gives the same bytes
        lm.plots.save(ax.figure, path)
        text = path.read_bytes()
    lm.plots.save(ax.figure, tmp_path / "again.pgf")
    assert (tmp_path / "again.pgf").read_bytes() == text
    labels = re.findall(r"\\pgftext\[.*?\]\{(.*)\}%$", text.decode(), re.M)
    shown = [label.rpartition(r"\def%{\%}")[2].removesuffix("}") for label in labels]
    assert f"{ESCAPED}: order 2.00" in shown and "100 \\% of $h$ \\ensuremath{-} 5\\_\\ensuremath{\\mu}m" in shown
    assert "$\\tau^2$ in \\%: order 4.00" in shown and "Störmer\\_1: order 3.00" in shown
    assert len(shown) >= 8 and not any(bare_specials(x.replace("{}", "")) for x in shown)
    assert b"mathdefault" not in text and b"\\usepackage{pgf}" in text
    for label in labels:
        plain = re.sub(r"\\[{}]", "", label)
        assert plain.count("{") == plain.count("}")


def test_shaded_pictures_have_their_dots_beside(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    run = lm.integrate(BODY, lm.RKMK(order=4), START, h=0.1, steps=50)
    ax = run.plot()
    lm.plots.save((ax if hasattr(ax, "figure") else ax[0]).figure, tmp_path / "sphere.pgf")
    text = (tmp_path / "sphere.pgf").read_text(encoding="utf-8")
    images = re.findall(r"\\pgfimage\[.*?\]\{(.*?)\}", text)
    assert images and all((tmp_path / name).is_file() for name in images)
    assert "includegraphics" not in text
