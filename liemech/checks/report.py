"""Reports of checked laws: a table of verdicts, or an error that names the law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

from ..errors import LawViolation
from ..simulation.reports.written_tables import html_table

ROUNDING = 2.0**-52
"""The unit in which defects are given, times the size of what is compared."""


def shown(name: str, values: Iterable[float]) -> str:
    """Numbers of a point, in few digits: `xi = (1.27, 0, -0.2)`."""
    return f"{name} = ({', '.join(f'{x + 0.0:.3g}' for x in values)})"


@dataclass(frozen=True)
class Finding:
    """The verdict on one law: the worst point, the defect there and its bound, in roundings of the
    size, and a remark.
    """

    law: str
    formula: str
    verdict: str  # "holds", "broken", "follows", "not there", "refused"
    where: str = ""
    defect: float = 0.0
    bound: float = 0.0
    size: float = 0.0
    remark: str = ""

    width: ClassVar[int] = 21  # of the numbers
    headings: ClassVar[tuple[str, ...]] = ("law", "verdict", "roundings, at worst", "where", "")

    def __str__(self) -> str:
        worst = f"{self.defect:>9.2g} of {self.bound:<8.3g} {self.where}" if self.bound else ""
        return f"{self.law:<29} {self.verdict:<9} {worst}  {self.remark}".rstrip()

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row, under the headings."""
        worst = f"{self.defect:.2g} of {self.bound:.3g}" if self.bound else ""
        return self.law, self.verdict, worst, self.where if self.bound else "", self.remark

    @property
    def details(self) -> list[str]:
        """The lines of an error about it."""
        unit, lines = ROUNDING * self.size, []
        if self.where:
            lines.append(f"  where     {self.where}")
        if self.bound:
            lines.append(f"  defect    {self.defect * unit:.1e}, {self.defect:.2g} roundings")
            lines.append(f"  expected  below {self.bound * unit:.1e}, {self.bound:.3g} roundings of {self.size:.2g}")
        if self.remark:
            lines.append(f"  {'probably' if self.bound else 'because '}  {self.remark}")
        return lines


@dataclass(frozen=True)
class Observation(Finding):
    """The verdict on one claim of a method: the number that was observed and the one that was
    wanted.

    Of what a method does not claim the verdict is "seen" or "not seen".
    """

    observed: str = ""
    wanted: str = ""

    width = 34
    headings = ("law", "verdict", "observed", "wanted", "where", "")

    def __str__(self) -> str:
        law, verdict, observed, *others = self.cells
        return f"{law:<29} {verdict:<9} {observed:<{self.width}} {'  '.join(others)}".rstrip()

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row, under the headings."""
        at = self.where if self.verdict == "broken" else ""
        return self.law, self.verdict, self.observed, self.wanted, at, self.remark

    @property
    def details(self) -> list[str]:
        """The lines of an error about it."""
        lines = [f"  observed  {self.observed}", f"  wanted    {self.wanted}"]
        lines += [f"  where     {self.where}"] if self.where and self.verdict == "broken" else []
        return [*lines, f"  because   {self.remark}"] if self.remark else lines


@dataclass(frozen=True)
class Report:
    """The verdict on each law; printed, a table.  Defects are in roundings (2^-52) of the size of
    what is compared.

    A law "holds" or is "broken"; it "follows" if the class leaves the method to its base; what a
    class lacks is "not there"; a retraction that does not serve a group is "refused"; what a method
    does not claim is "seen" or "not seen".
    """

    subject: str
    findings: tuple[Finding, ...]

    @property
    def broken(self) -> tuple[Finding, ...]:
        """The laws that do not hold, root causes first."""
        return tuple(f for f in self.findings if f.verdict == "broken")

    @property
    def held(self) -> tuple[Finding, ...]:
        """The findings on laws that hold."""
        return tuple(f for f in self.findings if f.verdict == "holds")

    def __getitem__(self, law: str) -> Finding:
        for finding in self.findings:
            if finding.law == law:
                return finding
        raise KeyError(f"{law!r} is none of the laws {', '.join(f.law for f in self.findings)}")

    def __bool__(self) -> bool:
        return not self.broken

    def __str__(self) -> str:
        first = self.findings[0]
        heading = "{:<29} {:<9} {:<{width}} {}".format(*first.headings, width=first.width)
        return "\n".join([self.verdict, heading, *map(str, self.findings)])

    def _repr_html_(self) -> str:
        return html_table(self.verdict, self.findings[0].headings, [finding.cells for finding in self.findings])

    @property
    def verdict(self) -> str:
        """All in one line: does it pass, and if not, which laws are broken?"""
        held, broken = len(self.held), ", ".join([f.law for f in self.broken])
        if broken:
            return f"{self.subject} fails: {broken} broken, {held} laws hold"
        return f"{self.subject} passes: {held} laws hold, none broken"

    def violation(self) -> LawViolation:
        """The first broken law as an error: where, by how much, and the probable cause."""
        first, *others = self.broken
        lines = [f"{self.subject} breaks the law of {first.law}: {first.formula}", *first.details]
        if others:
            lines.append(f"  also broken: {', '.join(f.law for f in others)}")
        return LawViolation("\n".join(lines))


def finished(subject: str, findings: Iterable[Finding], raises: bool) -> Report:
    """The report, or the first broken law as an error."""
    report = Report(subject, tuple(findings))
    if report.broken and raises:
        raise report.violation()
    return report
