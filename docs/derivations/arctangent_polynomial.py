"""The polynomial of `liemech.models.bodies.carlson`: atan(r)/r in w = r^2, interpolated in the Chebyshev
points of 0 <= w <= 0.172.

Each term of Carlson's R_J has the factor atan(r)/r, where r^2 is the product of
(sqrt p - sqrt x)/(sqrt p + sqrt x) over x, y, z. For x, y <= z <= p <= 2 z that is at most
(sqrt 2 - 1)/(sqrt 2 + 1) = 0.1716.
"""

import mpmath

mpmath.mp.dps = 50


def function(w: mpmath.mpf) -> mpmath.mpf:
    """atan(r)/r, w = r^2."""
    r = mpmath.sqrt(w)
    return mpmath.atan(r) / r if r else mpmath.mpf(1)


if __name__ == "__main__":
    coefficients, error = mpmath.chebyfit(function, [0, mpmath.mpf("0.172")], 12, error=True)
    for c in reversed(coefficients):
        print(f"    {float(c)!r},")
    print("error", mpmath.nstr(error, 2))
