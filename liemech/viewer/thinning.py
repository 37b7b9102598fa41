"""Which sites and samples of a large run a screen can show, and the words that say so."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..models.many.sites import lattice_of, of_sites

Numbers = NDArray[np.intp]

MOST_SITES = 12_000
"""Sites that are drawn: more would be smaller than a dot."""

MOST_NUMBERS = 5_000_000
"""Numbers of a page that move, two bytes each: what keeps it below 20 MB."""


FAR = 60.0
"""Samples that turn by more degrees from one to the next are not joined: the shortest way between
them was hardly that of the body.
"""


def shown_sites(system: Any, given: Any) -> tuple[Numbers | None, str]:
    """The numbers of the sites that are shown, and what to say of the others; None for a system of
    one body.

    Of a lattice every third is shown along each axis, or every fifth, ...: odd numbers, for every
    second site would show one sublattice of an antiferromagnet and hide the other.
    """
    group = of_sites(system)
    count = 0 if group is None else group.copies
    if given is not None:
        numbers = np.atleast_1d(np.asarray(given))
        whole = numbers.dtype.kind in "iu" and ((numbers >= 0) & (numbers < count)).all()
        if not whole or not 0 < numbers.size <= MOST_SITES:
            raise InvalidInput(
                f"sites are the numbers of those to show, from 0, {MOST_SITES} at most; {system!r} "
                f"has {count}; got {given!r}"
            )
        return numbers.ravel(), f"{numbers.size:,} of {count:,} sites"
    if group is None or count <= MOST_SITES:
        return (None if group is None else np.arange(count)), ""
    lattice, stride = lattice_of(system), 3
    shape = (count,) if lattice is None else lattice.shape
    while np.prod([-(-n // stride) for n in shape]) > MOST_SITES:
        stride += 2
    numbers = np.arange(count).reshape(shape)[(slice(None, None, stride),) * len(shape)].ravel()
    return numbers, f"{len(numbers):,} of {count:,} sites, one in {stride} along each axis"


def shown_samples(n: int, frames: int, numbers: int) -> Numbers:
    """Which of n samples are shown, the first and the last among them, evenly chosen: at most
    `frames`, and so many that they hold no more than `MOST_NUMBERS`, each of them `numbers`.
    """
    return evenly(n, max(2, min(frames, MOST_NUMBERS // max(numbers, 1))))


def evenly(n: int, most: int) -> Numbers:
    """The numbers from 0 to n - 1, or so many of them, the first and the last included."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.intp))
