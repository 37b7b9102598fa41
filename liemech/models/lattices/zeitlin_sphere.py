"""Ideal flow on the sphere by Zeitlin's truncation: vorticities as matrices of su(N).

    x_k -> hbar S_k,   {f, g} -> [F, G]/(i hbar),   hbar = 2/sqrt(N^2 - 1),

with the matrices S_k of spin (N - 1)/2, by which functions on the sphere up to degree N - 1 become
hermitian matrices F and Poisson brackets commutators.  All of {f, g} = n . (grad f x grad g) stays:
the rotations, the Laplacian with its eigenvalues l (l + 1), and as Casimirs N - 1 moments of the
vorticity.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, check_finite, dot, real_array, record
from ...formulas.large import Large
from ...formulas.large_maps import DiagonalSolver
from ...groups.matrices import matrix_basis
from ...groups.matrices.classical import SU
from ...groups.matrices.matrix_group import whole_number
from ...systems.hamiltonian import Hamiltonian
from ...systems.lagrangian import Lagrangian
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from .von_neumann import require_hermitian


@record
class SphereEnergy(Hamiltonian):
    """The kinetic energy of ideal flow, E = -int psi (omega - f)/2 with Delta psi = omega - f, of a
    vorticity as the momentum M = (4 pi hbar/N) i F.

    n : N.  background : the matrix of f, the vorticity of the rotating sphere; the number 0 if it rests.

    Source: Zeitlin, Phys. Rev. Lett. 93 (2004) 264501; Modin and Viviani, J. Fluid Mech. 884 (2020)
    A22.
    """

    n: int
    background: Any

    @cached_property
    def solver(self) -> DiagonalSolver:
        """The inverse of minus the quantised Laplacian, sum_k [S_k, [S_k, F]]: tridiagonal along every diagonal."""
        lower, diagonal, upper = laplacian(self.n)
        return DiagonalSolver(-lower, -diagonal, -upper)

    @cached_property
    def factor(self) -> float:
        """N/(4 pi hbar^2): what makes the solution for M the velocity."""
        return self.n * (self.n**2 - 1.0) / (16.0 * np.pi)

    @cached_property
    def group(self) -> SU:
        """The group of the matrices, SU(N)."""
        return SU(self.n)

    def energy(self, mu: Vec) -> float:
        """The kinetic energy.  mu : (N^2 - 1,)."""
        m = self.group.algebra.covector(mu)
        return 0.5 * dot(self.velocity_matrix(self.group.algebra, m), m - self.background)

    def gradient(self, mu: Vec) -> Vec:
        """The coordinates of X = -i Psi/hbar, Delta_N Psi = F - F_f.  mu : (N^2 - 1,)."""
        algebra = self.group.algebra
        return algebra.vee(self.velocity_matrix(algebra, algebra.covector(mu)))

    def velocity_matrix(self, algebra: Any, m: Mat) -> Mat:
        """X = -i Psi/hbar from the momentum M.  m : (N, N)."""
        return self.factor * self.solver(m - self.background)


@record
class ZeitlinSphere(LiePoissonSystem):
    """Euler's equations of ideal flow on the unit sphere, by Zeitlin's truncation to matrices N x N:

        omega' = {omega, psi},  Delta psi = omega - f    becomes    F' = [F, Psi]/(i hbar),  Delta_N Psi = F - F_f

    n : N, at least 13: harmonics up to degree N - 1 are resolved.  rotation : the angular velocity
    Omega of the sphere about its axis, in rad/s, f = 2 Omega z: the beta term; omega is the absolute
    vorticity.

    States are momenta on su(N); `from_harmonics` makes one of the coefficients of spherical
    harmonics, `harmonics` and `vorticity` go back.  `Isospectral(order=2)` keeps all Casimirs, to
    rounding, and is a Poisson map.

    `ViscousSphere(sphere, viscosity)` is this flow with viscosity.

    Conserved: energy, moments of the vorticity (the second is twice the enstrophy), and angular
    momentum, of a rotating sphere along its axis.

    Source: Zeitlin, Phys. Rev. Lett. 93 (2004) 264501; Hoppe and Yau, Comm. Math. Phys. 195 (1998);
    Modin and Viviani, J. Fluid Mech. 884 (2020) A22.
    """

    called: ClassVar[str] = "sphere"

    group: SU = field(init=False, repr=False)
    hamiltonian: SphereEnergy = field(init=False, repr=False)
    lagrangian: Lagrangian | None = field(init=False, repr=False, default=None)
    n: int
    rotation: float = 0.0

    def __repr__(self) -> str:
        suffix = f", rotation={self.rotation}" if self.rotation else ""
        return f"{type(self).__name__}({self.n}{suffix})"

    def __post_init__(self) -> None:
        n = whole_number("ZeitlinSphere", self.n, matrix_basis.SMALL + 1)
        if not np.isfinite(real_array(self.rotation, "ZeitlinSphere: rotation")):
            raise InvalidInput(f"ZeitlinSphere: rotation is {self.rotation}; it must be finite")
        background: Any = 0.0
        if self.rotation:
            turning = self._momentum_scale * 2.0j * self.rotation * coordinate(n)
            background = Large(np.diag(turning))
        for name, value in (
            ("n", n),
            ("group", SU(n)),
            ("hamiltonian", SphereEnergy(n, background)),
            ("lagrangian", None),
        ):
            object.__setattr__(self, name, value)

    @property
    def hbar(self) -> float:
        """The scale of brackets, 2/sqrt(N^2 - 1)."""
        return float(2.0 / np.sqrt(self.n**2 - 1.0))

    @property
    def _momentum_scale(self) -> float:
        return float(4.0 * np.pi * self.hbar / self.n)

    # ---------------------------------------------------------------- harmonics

    def from_harmonics(self, coefficients: Any) -> BodyState:
        """The state with the absolute vorticity sum a_lm Y_lm, in real orthonormal harmonics:
        Y_lm = sqrt(2) P_lm(z) cos(m phi) for m > 0, sqrt(2) P_l|m|(z) sin(|m| phi) for m < 0, the
        normalised Legendre functions positive near the north pole.

        coefficients : {(l, m): a}, or an array (L + 1, 2 L + 1) of a[l, L + m].  l from 1 to N - 1.
        Raises InvalidInput for other degrees: the sum of the vorticity over the sphere is zero.
        """
        by_degree = np.zeros((self.n, 2 * self.n - 1))
        for (l, m), a in _given(coefficients).items():
            if not 1 <= l < self.n or abs(m) > l:
                raise InvalidInput(
                    f"ZeitlinSphere.from_harmonics: (l, m) = ({l}, {m}); l goes from 1 to N - 1 = "
                    f"{self.n - 1}, m from -l to l"
                )
            by_degree[l, self.n - 1 + m] = a
        matrix = self._matrix_of(by_degree)
        return self.state(self.group.algebra.pairing(1j * self._momentum_scale * matrix))

    def from_matrix(self, matrix: Any) -> BodyState:
        """The state with the absolute vorticity that this hermitian matrix F stands for: the inverse of `matrix`.

        matrix : (N, N).  Raises InvalidInput for one that is not hermitian, as that of a field which is not
        real, or has a trace, the sum of the vorticity over the sphere.
        """
        name, n = "ZeitlinSphere.from_matrix: matrix", self.n
        array = real_array(matrix, name, or_complex=True)
        if array.shape != (n, n):
            raise InvalidInput(f"{name} has shape {array.shape}; it must be ({n}, {n})")
        check_finite(array, name)
        require_hermitian(name, array, "is not hermitian, as that of a real field is")
        trace = float(np.trace(array).real)
        if not abs(trace) <= 1e-12 * n * np.abs(array).max():
            raise InvalidInput(
                f"{name} has the trace {trace:g}; it must be zero, for so is the sum of the vorticity over the "
                f"sphere: subtract {trace / n:g} times the unit matrix"
            )
        return self.state(self.group.algebra.pairing(1j * self._momentum_scale * array))

    def _matrix_of(self, a: np.ndarray) -> np.ndarray:
        """F, hermitian, of coefficients a[l, N - 1 + m]."""
        n, matrix = self.n, np.zeros((self.n, self.n), dtype=complex)
        degrees = np.flatnonzero(a.any(axis=1))
        largest = int(degrees[-1]) if len(degrees) else 0
        for m in range(largest + 1):
            up, down = a[m : largest + 1, n - 1 + m], a[m : largest + 1, n - 1 - m]
            if not (up.any() or down.any()):
                continue
            vectors = self._along(m, largest)
            size = np.sqrt(n / (4.0 * np.pi)) if m == 0 else np.sqrt(n / (8.0 * np.pi))
            band = size * (vectors @ (up if m == 0 else up - 1j * down))
            j = np.arange(n - m)
            matrix[j, j + m] = band
            matrix[j + m, j] = np.conj(band)
        return matrix

    def _along(self, m: int, largest: int) -> np.ndarray:
        """Along the diagonal m the eigenvectors of the Laplacian for l = m, ..., largest, positive in the north."""
        from scipy.linalg import eigh_tridiagonal

        _, diagonal, upper = laplacian(self.n)
        j = np.arange(self.n - m)
        d, e = -diagonal[j, j + m], -upper[j[:-1], j[:-1] + m]
        _, vectors = eigh_tridiagonal(d, e, select="i", select_range=(0, largest - m))
        return np.asarray(vectors * np.sign(vectors[0]))

    def matrix(self, mu: Any) -> np.ndarray:
        """The hermitian matrix F of the absolute vorticity.  mu : (..., N^2 - 1); (..., N, N)."""
        m = self.group.generated.covector(checked_momenta(self, mu, "matrix"))
        return np.asarray(-1j / self._momentum_scale * m)

    def harmonics(self, mu: Any, degrees: int | None = None) -> np.ndarray:
        """The coefficients a[l, L + m] of the absolute vorticity up to degree L (default N - 1):
        the inverse of `from_harmonics`.  mu : (..., N^2 - 1); (..., L + 1, 2 L + 1).
        """
        n, f = self.n, self.matrix(mu)
        largest = n - 1 if degrees is None else min(whole_number("degrees", degrees, 0), n - 1)
        by_degree = np.zeros((*f.shape[:-2], largest + 1, 2 * largest + 1))
        for m in range(largest + 1):
            j = np.arange(n - m)
            size = np.sqrt(n / (4.0 * np.pi)) if m == 0 else np.sqrt(n / (8.0 * np.pi))
            band = f[..., j, j + m] @ self._along(m, largest) / size
            by_degree[..., m:, largest + m] = band.real
            if m:
                by_degree[..., m:, largest - m] = -band.imag
        by_degree[..., 0, :] = 0.0
        return by_degree

    def vorticity(self, mu: Any, latitude: Any, longitude: Any, degrees: int | None = None) -> np.ndarray:
        """The absolute vorticity on a grid, in rad/s.  mu : (..., N^2 - 1), latitude : (a,),
        longitude : (b,), in rad; (..., a, b).  degrees : harmonics beyond are left out.
        """
        a = self.harmonics(mu, degrees)
        largest, z = (a.shape[-2] - 1, np.sin(real_array(latitude, "ZeitlinSphere.vorticity: latitude")))
        phi = real_array(longitude, "ZeitlinSphere.vorticity: longitude")
        for name, angles in (("latitude", z), ("longitude", phi)):
            if angles.ndim != 1:
                raise InvalidInput(f"ZeitlinSphere.vorticity: {name} has shape {angles.shape}; give (m,)")
        along = np.empty((*a.shape[:-2], len(z), 2 * largest + 1))  # by order, -L to L
        for m in range(largest + 1):
            p = legendre(m, largest, z) * (np.sqrt(2.0) if m else 1.0)
            for order in {m, -m}:
                along[..., largest + order] = a[..., m:, largest + order] @ p
        orders = np.arange(-largest, largest + 1)[:, None]
        around = np.where(orders < 0, np.sin(-orders * phi), np.cos(orders * phi))
        return np.asarray(along @ around)

    # ---------------------------------------------------------------- what is conserved

    def moments(self, mu: Any, powers: tuple[int, ...] = (2, 3, 4)) -> np.ndarray:
        """The Casimirs int omega^k = (4 pi/N) tr F^k.  mu : (..., N^2 - 1); (..., powers)."""
        levels = self.levels(mu)
        scale = 4.0 * np.pi / self.n
        return np.stack([scale * np.sum(levels**k, axis=-1) for k in powers], axis=-1)

    def levels(self, mu: Any) -> np.ndarray:
        """The eigenvalues of F, from below: the values that the vorticity takes, each on a part of 1/N
        of the sphere.  All of them are Casimirs.  mu : (..., N^2 - 1); (..., N).
        """
        return np.linalg.eigvalsh(self.matrix(mu))

    def enstrophy(self, mu: Any) -> np.ndarray:
        """int omega^2/2.  mu : (..., N^2 - 1)."""
        return np.asarray(0.5 * self.moments(mu, (2,))[..., 0])

    def angular_momentum(self, mu: Any) -> np.ndarray:
        """int omega n, from the harmonics of degree 1.  mu : (..., N^2 - 1); (..., 3)."""
        f, n = self.matrix(mu), self.n
        a = self.hbar * ladder(n)[1:]
        j = np.arange(n - 1)
        off = np.sum(a * f[..., j, j + 1], axis=-1)
        z = np.sum(coordinate(n) * np.einsum("...ii->...i", f).real, axis=-1)
        return np.asarray(4.0 * np.pi / n * np.stack([off.real, -off.imag, z], axis=-1))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, moments of the vorticity, and angular momentum."""
        mu = states["mu"]
        moments, turning = self.moments(mu), self.angular_momentum(mu)
        constants = {"energy": np.asarray(self.energy(mu)), "enstrophy": 0.5 * moments[..., 0]}
        constants |= {f"moment {k}": moments[..., k - 2] for k in (3, 4)}
        along = turning[..., 2] if self.rotation else turning
        return constants | {"angular momentum": along}


def checked_momenta(system: Any, mu: Any, name: str) -> np.ndarray:
    """Momenta, (..., dim), as an array.  name : of the method, for the message.  Raises InvalidInput for other shapes."""
    name, dim = f"{type(system).__name__}.{name}: mu", system.group.dim
    array = real_array(mu, name)
    if array.shape[-1:] != (dim,):
        raise InvalidInput(f"{name} has shape {array.shape}; its last axis must be {dim}")
    return array


def _is_whole(k: Any) -> bool:
    return isinstance(k, (int, np.integer)) and not isinstance(k, bool)


def _given(coefficients: Any) -> dict[tuple[int, int], float]:
    """Coefficients by degree and order."""
    name = "ZeitlinSphere.from_harmonics: coefficients"
    if isinstance(coefficients, dict):
        by_degree = {}
        for key, a in coefficients.items():
            if not (isinstance(key, tuple) and len(key) == 2 and all(_is_whole(k) for k in key)):
                raise InvalidInput(f"{name} have the key {key!r}; it must be (l, m), two integers")
            number = real_array(a, f"{name}[{key}]")
            if number.ndim or not np.isfinite(number):
                raise InvalidInput(f"{name}[{key}] is {a!r}; it must be a finite real number")
            by_degree[int(key[0]), int(key[1])] = float(number)
        return by_degree
    a = real_array(coefficients, "ZeitlinSphere.from_harmonics: coefficients")
    if a.ndim != 2 or a.shape[1] != 2 * a.shape[0] - 1:
        raise InvalidInput(
            f"ZeitlinSphere.from_harmonics: coefficients has shape {a.shape}; it must be (L + 1, 2 L + 1)"
        )
    largest = len(a) - 1
    return {(int(l), int(k) - largest): float(a[l, k]) for l, k in np.argwhere(a != 0.0)}


def coordinate(n: int) -> np.ndarray:
    """The diagonal of hbar S_z: z from north to south.  (n,)"""
    return (0.5 * (n - 1) - np.arange(n)) * (2.0 / np.sqrt(n**2 - 1.0))


def ladder(n: int) -> np.ndarray:
    """(S_+)_j-1,j = sqrt(j (n - j)), j = 0, ..., n - 1."""
    j = np.arange(n)
    return np.sqrt(j * (n - j))


def laplacian(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The quantised Laplacian -sum_k [S_k, [S_k, F]], which couples F_jk with its neighbours on its
    diagonal: the coefficients of F_j-1,k-1, F_jk and F_j+1,k+1, (n, n) each.

    Source: Hoppe and Yau, Comm. Math. Phys. 195 (1998).
    """
    a, s = ladder(n), 0.5 * (n - 1)
    z = s - np.arange(n)
    lower = np.outer(a, a)
    upper = np.zeros((n, n))
    upper[:-1, :-1] = lower[1:, 1:]
    return lower, 2.0 * np.outer(z, z) - 2.0 * s * (s + 1.0), upper


def laplacian_matrix(n: int, shift: float = 0.0) -> Any:
    """The matrix, of SciPy's, of Delta_N + shift for the numbers of a complex matrix (n, n), one after the other."""
    from scipy.sparse import coo_array

    j, k = np.indices((n, n))
    rows, columns, values = [], [], []
    lower, diagonal, upper = laplacian(n)
    for step, coefficients in ((-1, lower), (0, diagonal + shift), (1, upper)):
        nonzero = (np.minimum(j, k) + step >= 0) & (np.maximum(j, k) + step < n) & (coefficients != 0.0)
        at = n * j[nonzero] + k[nonzero]
        for part in (0, 1):
            rows.append(2 * at + part)
            columns.append(2 * (at + step * (n + 1)) + part)
            values.append(coefficients[nonzero])
    places = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(values), places), (2 * n * n, 2 * n * n))


def legendre(m: int, largest: int, z: np.ndarray) -> np.ndarray:
    """The Legendre functions of order m, degrees m to `largest`, orthonormal on the sphere, positive
    near z = 1.  (largest - m + 1, ...)

    Source: NIST Handbook of Mathematical Functions, 14.10.3 and 14.30.1.
    """
    functions = np.zeros((largest - m + 1, *z.shape))
    sectoral = np.full(z.shape, np.sqrt(1.0 / (4.0 * np.pi)))
    for k in range(1, m + 1):
        sectoral = sectoral * np.sqrt((2.0 * k + 1.0) / (2.0 * k) * (1.0 - z * z))
    functions[0] = sectoral
    if largest > m:
        functions[1] = np.sqrt(2.0 * m + 3.0) * z * sectoral
    for l in range(m + 2, largest + 1):
        a = np.sqrt((4.0 * l * l - 1.0) / (l * l - m * m))
        b = np.sqrt(((l - 1.0) ** 2 - m * m) / (4.0 * (l - 1.0) ** 2 - 1.0))
        functions[l - m] = a * (z * functions[l - m - 1] - b * functions[l - m - 2])
    return functions
