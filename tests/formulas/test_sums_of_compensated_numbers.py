"""Sums of numbers that carry what was rounded off."""

from __future__ import annotations

from fractions import Fraction

from liemech.formulas.numbers.compensated import Compensated


def test_both_rests_are_added() -> None:
    def exact(x: Compensated) -> Fraction:
        return Fraction(x.value) + Fraction(x.rest)

    large, small = Compensated(1.0, 2.0**-60), Compensated(2.0**-30, 2.0**-85)
    for found, wanted in ((large + small, exact(large) + exact(small)), (large - small, exact(large) - exact(small))):
        assert abs(exact(found) - wanted) < Fraction(2) ** -82
