"""Random numbers by counters: Philox, a function from counters to numbers that look random.

Nothing is remembered from one number to the next, so that a step of a run has its noise by its number, in
plain Python and in native code, alone and in lanes, after a resume and on any worker.

Source: Salmon, Moraes, Dror, Shaw, Parallel random numbers: as easy as 1, 2, 3, SC '11 (2011), Philox-4x32-10.
"""

from __future__ import annotations

import math
from typing import Any

from ..functions import cos, log, sin, sqrt

ROUNDS = 10
MULTIPLIERS = 0xD2511F53, 0xCD9E8D57
WEYL = 0x9E3779B9, 0xBB67AE85
"""Added to the key before each round but the first: the golden ratio and sqrt(3) - 1, as fractions of 2^32."""

WORD = 2**32 - 1

LARGEST = 2**53
"""Counters and seeds are whole numbers from zero to below this: floats without rounding."""


def words(counter: tuple[int, ...], key: tuple[int, ...]) -> tuple[int, ...]:
    """Four words of 32 bits, from four of a counter and two of a key."""
    a, b, c, d = counter
    k, m = key
    for i in range(ROUNDS):
        if i > 0:
            k, m = (k + WEYL[0]) & WORD, (m + WEYL[1]) & WORD
        first, second = MULTIPLIERS[0] * a, MULTIPLIERS[1] * c
        a, b, c, d = (second >> 32) ^ b ^ k, second & WORD, (first >> 32) ^ d ^ m, first & WORD
    return a, b, c, d


def uniforms(seed: float, path: float, number: float, block: int) -> tuple[Any, Any]:
    """Two numbers between 0 and 1, never 0 nor 1, by counters: the number of a step, of a path, and of a block.

    seed, path, number : whole numbers from 0 to below 2^53.  block : from 0 to below 2^11.  Native code computes
    it in words, `Emitter.uniforms`.
    """
    n, p, s = int(number), int(path), int(seed)
    counter = n & WORD, (n >> 32) | (block << 21), p & WORD, p >> 32
    a, b, c, d = words(counter, (s & WORD, s >> 32))
    return _fraction(a, b), _fraction(c, d)


def _fraction(a: int, b: int) -> float:
    """(k + 1/2) 2^-52 with the 52 first bits k of two words."""
    return ((a << 20 | b >> 12) + 0.5) * 2.0**-52


def normals(seed: float, path: float, number: float, count: int) -> list[Any]:
    """Independent normal numbers of mean 0 and variance 1, `count` of them.

    Source: Box and Muller, Ann. Math. Statist. 29 (1958), 610.
    """
    samples: list[Any] = []
    for block in range((count + 1) // 2):
        u, v = uniforms(seed, path, number, block)
        size, angle = sqrt(-2.0 * log(u)), 2.0 * math.pi * v
        samples = [*samples, size * cos(angle), size * sin(angle)]
    return samples[:count]
