"""Whole powers of complex numbers with parts of any kind."""

from __future__ import annotations

from liemech.formulas.numbers.complex_numbers import Complex


def test_powers_are_products() -> None:
    z = Complex(3.0, 2.0)
    for n in range(-4, 9):
        power, exact = z**n, complex(3.0, 2.0) ** n
        assert abs(complex(power.re, power.im) - exact) <= 1e-15 * abs(exact)
