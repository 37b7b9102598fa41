"""Numbers of a hundred digits, for the constants of exact motions."""

from __future__ import annotations

from decimal import Decimal

DIGITS = 100
PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651"
)


def cos_sin(x: Decimal) -> tuple[Decimal, Decimal]:
    """cos x and sin x, |x| <= pi, by their series at x/8.  Source: DLMF 4.19.1, 4.19.2."""
    y = x / 8
    cosine, sine, term, n = Decimal(0), Decimal(0), Decimal(1), 0
    while abs(term) > Decimal(10) ** -(DIGITS + 18):
        part = term if n % 4 < 2 else -term
        if n % 2:
            sine += part
        else:
            cosine += part
        n += 1
        term = term * y / n
    for _ in range(3):
        cosine, sine = 1 - 2 * sine * sine, 2 * sine * cosine
    return cosine, sine
