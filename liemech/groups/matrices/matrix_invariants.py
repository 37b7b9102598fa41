"""Invariants of the elements of a group of matrices: found once from the generators, it tells
elements from other matrices.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement, permutations
from typing import Any

import numpy as np

from ...formulas.classes.frozen import frozen
from .matrix_basis import MatrixBasis, clean, real_parts

CUBIC = 8
"""Up to so many rows invariant cubic forms are looked for."""


@frozen
class Invariants:
    """The laws g v = v, w^T g = w^T, g A = A g, g^T B g = B, g^H B g = B, g C g^T = C, g C g^H = C,
    T(g x, g y, g z) = T(x, y, z), det g = 1, |det g| = 1 or det g > 0, and g v = s v, s > 0.

    cubic : T, symmetric, (n, n, n), one combination of all there are; only where the other laws
    leave too much freedom.  rays : v, the real directions that every element stretches.
    enough : do they leave no more freedom than the group has, so that g E_i g^-1 need not be looked
    at?
    """

    vectors: tuple[np.ndarray, ...] = ()
    covectors: tuple[np.ndarray, ...] = ()
    commuting: tuple[np.ndarray, ...] = ()
    forms: tuple[np.ndarray, ...] = ()
    hermitian: tuple[np.ndarray, ...] = ()
    coforms: tuple[np.ndarray, ...] = ()
    cohermitian: tuple[np.ndarray, ...] = ()
    determinant: str = "any"  # "1", "unit", "positive" or "any"
    cubic: tuple[np.ndarray, ...] = ()
    rays: tuple[np.ndarray, ...] = ()
    enough: bool = True


def invariants_of(basis: MatrixBasis) -> Invariants:
    """Each law by its linear equations on the algebra, solved by singular values.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 3.3 (from
    conditions on g to conditions on X).
    """
    e, n = basis.generators, basis.n
    unity, traces = np.eye(n), np.einsum("iaa->i", e)
    transposed, conjugate = e.swapaxes(1, 2), np.conj(e)
    size = np.abs(e).max()

    def unknown(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, ...]:
        """All B with left_i B + B right_i = 0."""
        equations = np.einsum("iac,bd->iabcd", left, unity) + np.einsum("idb,ac->iabcd", right, unity)
        return tuple(b.reshape(n, n) for b in null_space(equations.reshape(-1, n * n)))

    vectors = null_space(e.reshape(-1, n))
    covectors = null_space(transposed.reshape(-1, n))
    commuting = [a for a in unknown(e, -e) if np.abs(a - a[0, 0] * unity).max() > 1e-9]
    forms, coforms = unknown(transposed, e), unknown(e, transposed)
    hermitian: tuple[np.ndarray, ...] = ()
    cohermitian: tuple[np.ndarray, ...] = ()
    if basis.complex:
        hermitian = unknown(conjugate.swapaxes(1, 2), e)
        cohermitian = unknown(e, conjugate.swapaxes(1, 2))
    free, unit = np.abs(traces).max() <= 1e-12 * size, np.abs(traces.real).max() <= 1e-12 * size
    laws = Invariants(
        tuple(vectors),
        tuple(covectors),
        tuple(commuting),
        forms,
        hermitian,
        _not_inverse(coforms, forms),
        _not_inverse(cohermitian, hermitian),
        "1" if free else "unit" if unit else "any" if basis.complex else "positive",
        rays=() if free and n < 2 else _rays(e),
    )
    enough = basis.dim == _freedom(laws, n, basis.complex)
    if not enough and n <= CUBIC:
        laws = replace(laws, cubic=_cubic_forms(e))
        enough = basis.dim == _freedom(laws, n, basis.complex)
    return replace(laws, enough=enough)


def _rays(e: np.ndarray) -> tuple[np.ndarray, ...]:
    """The real vectors that every generator stretches or leaves alone: eigenvectors of a generic one
    of the algebra, with simple eigenvalues.  e : (dim, n, n).
    """
    if np.iscomplexobj(e):
        return ()
    values, vectors = np.linalg.eig(np.einsum("k,kij->ij", np.cos(np.arange(1.0, len(e) + 1.0)), e))
    rays = []
    for k, (value, v) in enumerate(zip(values, vectors.T, strict=True)):
        gap = np.abs(np.delete(values, k) - value).min(initial=np.inf)
        if abs(value.imag) == 0.0 and gap > 1e-6 * np.abs(values).max():
            v = v.real / np.linalg.norm(v.real)
            moved = e @ v
            if np.abs(moved - np.outer(moved @ v, v)).max() <= 1e-10 * np.abs(e).max():
                rays.append(v)
    return tuple(rays)


def _cubic_forms(e: np.ndarray) -> tuple[np.ndarray, ...]:
    """One generic combination of the symmetric T with T(E x, y, z) + T(x, E y, z) + T(x, y, E z) = 0
    for all generators; none if there is no such form.  e : (dim, n, n).
    """
    n = e.shape[1]
    places = [*combinations_with_replacement(range(n), 3)]
    spread = np.zeros((n, n, n, len(places)))
    for k, place in enumerate(places):
        for i, j, l in permutations(place):
            spread[i, j, l, k] = 1.0
    rows = _moved_cubic(e, spread)[(slice(None), *np.transpose(places))]
    forms = null_space(rows.reshape(-1, len(places)))
    mixed = spread @ (np.cos(np.arange(len(forms))) @ forms)
    return (mixed,) if len(forms) else ()


def _not_inverse(coforms: tuple[np.ndarray, ...], forms: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """The coforms, unless forms can be inverted and say the same."""
    return () if any(np.linalg.cond(b) < 1e6 for b in forms) else coforms


def null_space(equations: np.ndarray) -> np.ndarray:
    """The solutions of linear equations, as rows in reduced form, their largest entry 1.
    equations : (m, k), rows : (r, k).
    """
    equation_count, unknowns = equations.shape
    if equation_count > 8 * unknowns:  # of many generators: twice as many mixtures of them say the same
        mixed = np.random.default_rng(1).normal(size=(2 * unknowns, equation_count))
        equations = mixed @ equations / np.sqrt(equation_count)
    _, sizes, v = np.linalg.svd(equations, full_matrices=True)
    rank = int((sizes > 1e-10 * max(sizes.max(initial=0.0), 1e-300)).sum())
    rows = np.conj(v[rank:]).copy()
    done = 0
    # to reduced echelon form, so that simple solutions look simple
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        best = done + int(np.abs(rows[done:, column]).argmax())
        if abs(rows[best, column]) < 1e-8:
            continue
        rows[[done, best]] = rows[[best, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    if not len(rows):
        return rows
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    if np.iscomplexobj(rows):
        return clean(rows.real) + 1j * clean(rows.imag)
    return clean(rows)


def _freedom(laws: Invariants, n: int, complex_: bool) -> int:
    """The dimension of the algebra that the laws alone would allow."""
    units = np.eye(n * n).reshape(-1, n, n)
    space = np.concatenate([units, 1j * units]) if complex_ else units
    conditions = [np.zeros((len(space), 1))]

    def ask(values: np.ndarray) -> None:
        conditions.append(real_parts(values.reshape(len(space), -1), complex_))

    for v in laws.vectors:
        ask(space @ v)
    for w in laws.covectors:
        ask(w @ space)
    for a in laws.commuting:
        ask(space @ a - a @ space)
    star = np.conj(space).swapaxes(1, 2)
    flip = space.swapaxes(1, 2)
    for b in laws.forms:
        ask(flip @ b + b @ space)
    for b in laws.hermitian:
        ask(star @ b + b @ space)
    for c in laws.coforms:
        ask(space @ c + c @ flip)
    for c in laws.cohermitian:
        ask(space @ c + c @ star)
    for t in laws.cubic:
        ask(_moved_cubic(space, t))
    trace = np.einsum("iaa->i", space)
    if laws.determinant == "1":
        ask(trace)
    elif laws.determinant == "unit":
        ask(trace.real)
    return len(space) - int(np.linalg.matrix_rank(np.concatenate(conditions, axis=1), tol=1e-9))


def _moved_cubic(x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """T(x ., ., .) + T(., x ., .) + T(., ., x .) for matrices x, (m, n, n), and one T or many, (n, n,
    n, ...).  (m, n, n, n, ...)
    """
    turned = np.einsum("xai,ajl...->xijl...", x, t)
    return np.asarray(turned + turned.swapaxes(1, 2) + turned.swapaxes(1, 3))


def objections(laws: Invariants, basis: MatrixBasis | None, g: np.ndarray) -> list[tuple[float, str]]:
    """How far each law is broken, relative to the size of an element, and words for it.
    g : (n, n).
    """
    size, star = max(1.0, float(np.linalg.norm(g)) / len(g) ** 0.5), np.conj(g).T
    breaches: list[tuple[float, str]] = []

    def law(off: np.ndarray, scale: float, words: str) -> None:
        worst = float(np.abs(off).max(initial=0.0))
        breaches.append((worst / scale if scale < np.inf else np.inf, words.format(worst)))

    def form(kind: str, transposed: str, b: np.ndarray, off: np.ndarray) -> None:
        name = "the unit matrix" if np.array_equal(b, np.eye(len(b))) else "B"
        product = f"{transposed} g" if name != "B" else f"{transposed} B g"
        what = "" if name != "B" else f", with the {kind} form B = {_shown(b)} of the group"
        law(off, size**2, f"{product} differs from {name} by {{:.1e}}{what}")

    for b in laws.forms:
        kind = "antisymmetric" if np.allclose(b, -b.T) else "symmetric" if np.allclose(b, b.T) else "bilinear"
        form(kind, "g^T", b, g.T @ b @ g - b)
    for b in laws.hermitian:
        form("sesquilinear", "g^H", b, star @ b @ g - b)
    for c in laws.coforms:
        law(g @ c @ g.T - c, size**2, f"g C g^T differs from C = {_shown(c)} by {{:.1e}}")
    for c in laws.cohermitian:
        law(g @ c @ star - c, size**2, f"g C g^H differs from C = {_shown(c)} by {{:.1e}}")
    for v in laws.vectors:
        law(g @ v - v, size, f"it moves the vector {_shown(v)}, which every element leaves alone, by {{:.1e}}")
    for w in laws.covectors:
        law(w @ g - w, size, f"it changes the covector {_shown(w)}, which every element leaves alone, by {{:.1e}}")
    for a in laws.commuting:
        law(g @ a - a @ g, size, f"it does not commute with {_shown(a)}, off by {{:.1e}}")
    for t in laws.cubic:
        moved = np.einsum("abc,ai,bj,ck->ijk", t, g, g, g, optimize=True)
        law((moved - t) / np.abs(t).max(), size**3, "it changes a cubic form of the group by {:.1e}")
    for v in laws.rays:
        along = float(v @ g @ v)
        words = f"it does not stretch {_shown(v)} by a positive factor, as every element does"
        law(g @ v - max(along, 0.0) * v, size, words + ", but is off by {:.1e}")
    if laws.determinant == "positive":
        if np.linalg.det(g) < 0.0:
            breaches.append((1.0, "its determinant is negative"))
    elif laws.determinant != "any":
        det = np.linalg.det(g)
        scale = max(1.0, float(np.prod(np.linalg.norm(g, axis=1))))
        value = f"{det.real:.6g}" if abs(det.imag) < 1e-9 * abs(det) else f"{det:.6g}"
        words = (
            f"its determinant is {value}, not 1"
            if laws.determinant == "1"
            else f"its determinant {value} is not of modulus 1"
        )
        if abs(det + 1.0) < 1e-6 and laws.forms and not np.iscomplexobj(g):
            words = "its determinant is -1, it is a reflection"
        law(np.array([det - 1.0 if laws.determinant == "1" else abs(det) - 1.0]), scale, words)
    if np.linalg.det(g) == 0.0:
        breaches.append((1.0, "it is singular"))
    if not laws.enough and basis is not None and np.linalg.det(g) != 0.0:
        moved = g @ basis.generators @ np.linalg.inv(g)
        off = basis.sticks_out(moved) / np.maximum(np.linalg.norm(moved, axis=(1, 2)), 1e-300)
        worst = int(off.argmax())
        breaches.append(
            (float(off[worst]), f"g E_{worst + 1} g^-1 sticks out of the algebra by {off[worst]:.1e} of its size")
        )
    return breaches


def _shown(values: Any) -> str:
    return np.array2string(np.asarray(values), separator=", ", precision=4, suppress_small=True, threshold=16).replace(
        "\n", ""
    )
