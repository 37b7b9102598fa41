"""Random numbers by counters: published values, the same bits everywhere, and the moments of what they say they are."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas.numbers.philox import normals, uniforms, words

KNOWN = [  # Random123 1.14, tests/kat_vectors, philox4x32 10
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((2**32 - 1,) * 4, (2**32 - 1,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_known_answers(counter: tuple[int, ...], key: tuple[int, ...], expected: tuple[int, ...]) -> None:
    assert words(counter, key) == expected


@lm.record
class Drawn(lm.GroupEquation):
    """An equation whose velocity is random numbers, so that native code draws them."""

    group: lm.LieGroup
    seed: float
    count: int

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        drawn = normals(self.seed, g[1], t, self.count)
        return lm.vec(drawn[0] + drawn[-1], 0.0 * drawn[0])


@pytest.mark.compiled
@pytest.mark.parametrize("seed", [0.0, 1.0, 2.0**32 + 5.0, 2.0**53 - 1.0])
def test_native_code_draws_the_same_bits(seed: float) -> None:
    equation = Drawn(lm.VectorSpace(2), seed, 5)
    paths = [0.0, 1.0, 2.0**32, 2.0**40 + 3.0, 2.0**53 - 1.0]
    start = equation.state([[0.0, path] for path in paths])
    runs = [
        lm.integrate(equation, lm.RKMK(order=1), start, h=1.0, steps=50, t0=2.0**33, compiled=native)
        for native in (False, True)
    ]
    assert np.array_equal(runs[0].g, runs[1].g)
    for i, path in enumerate(paths):
        alone = lm.integrate(
            equation, lm.RKMK(order=1), equation.state([0.0, path]), h=1.0, steps=50, t0=2.0**33,
            compiled=True,
        )  # fmt: skip
        assert np.array_equal(alone.g, runs[0].g[:, i])


def test_every_counter_counts() -> None:
    given = [(0.0, 0.0, 0.0, 0), (1.0, 0.0, 0.0, 0), (0.0, 1.0, 0.0, 0), (0.0, 0.0, 1.0, 0), (0.0, 0.0, 0.0, 1),
             (2.0**32, 0.0, 0.0, 0), (0.0, 2.0**32, 0.0, 0), (0.0, 0.0, 2.0**32, 0)]  # fmt: skip
    drawn = [u for counters in given for u in uniforms(*counters)]
    assert len(set(drawn)) == len(drawn) and all(0.0 < u < 1.0 for u in drawn)


@pytest.mark.slow
def test_moments_and_independence() -> None:
    n = 40_000
    z = np.array([normals(3.0, float(i % 7), float(i), 3) for i in range(n)])
    assert np.abs(z.mean(axis=0)).max() < 4.5 / n**0.5
    covariance = z.T @ z / n - np.eye(3)
    assert np.abs(covariance).max() < 4.5 * (2.0 / n) ** 0.5
    assert abs((z**4).mean() - 3.0) < 4.5 * (96.0 / (3 * n)) ** 0.5
    lagged = (z[1:] * z[:-1]).mean(axis=0)
    assert np.abs(lagged).max() < 4.5 / n**0.5
