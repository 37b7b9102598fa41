"""Fields on a group in cells along a line: many sites, the nodes, which cells tie."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, check_finite, real_array, record
from ...formulas.classes.derived import closed_form_of
from ...formulas.classes.of_each import Each
from ...simulation.reports.drift import Drift
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ..sites.graphs import edges
from ..sites.terms.terms import PerSite, Terms
from .density import on_parts


@record
class FieldInCells(MechanicalSystem):
    """A field g(s, t) with the density l(eta, xi) = T(xi) - Phi(eta), eta = g^-1 g_s, xi = g^-1 g_t, in cells
    between nodes along a line; abstract.

        H = sum_j w_j T*(mu_j/w_j) + sum_cells l Phi(tau^-1(g_j^-1 g_j+1)/l) + what acts on nodes

    w_j is the length l of a cell, l/2 at the ends of a line that is not closed.  A subclass has `target`, `density`,
    `element`, `length`, `cells`, `closed` and `retraction`, as fields or properties, and says what is `held`, and what
    `others` act on nodes.  KickDrift() solves the discrete covariant Euler-Poincare equations at node j and time k,

        w_j (mu-_jk - mu+_j,k-1)/h + lam-_jk - lam+_j-1,k = w_j f_jk

    with mu = dl/dxi of steps and lam = dl/deta of cells, carried to their starts (-) and ends (+).

    Source: Demoures, Gay-Balmaz, Kobilarov and Ratiu, Commun. Nonlinear Sci. Numer. Simul. 19 (2014), 3492;
    Marsden, Patrick and Shkoller, Commun. Math. Phys. 199 (1998), 351 (multisymplectic integrators).
    """

    if TYPE_CHECKING:  # fields here would be arguments of every such system

        def __getattr__(self, name: str) -> Any: ...

    body: Any = field(init=False, repr=False)
    potential: Any = field(init=False, repr=False)
    load: Any = field(init=False, repr=False)

    def others(self) -> tuple[list[Any], Any]:
        """Terms of the potential beside that of cells, and the load, None if there is none."""
        return [], None

    def held(self) -> tuple[list[int], list[int]]:
        """The nodes that do not move, and those that turn where they are."""
        return [], []

    def __post_init__(self) -> None:
        self._check()
        n, (terms, load), (held, pinned) = self.cells, self.others(), self.held()
        pairs = np.stack([np.arange(n), (np.arange(n) + 1) % self.nodes], axis=1)
        cells = self.element.over(edges(pairs, sites=self.nodes, ordered=True))
        kinetic: Any = PerSite(on_parts(self.density.kinetic, self.parts))
        object.__setattr__(self, "body", LiePoissonSystem(self.target**self.nodes, kinetic))
        object.__setattr__(self, "potential", Terms(cells, *terms, held=held, pinned=pinned))
        object.__setattr__(self, "load", load)
        super().__post_init__()

    def _check(self) -> None:
        """Raise InvalidInput or InvalidType for what is no field."""

    # ---------------------------------------------------------------- shapes

    @property
    def nodes(self) -> int:
        """The number of nodes, one more than cells where the line is not closed."""
        return self.cells if self.closed else self.cells + 1

    @property
    def arc(self) -> np.ndarray:
        """Where the nodes are along the line, (nodes,)."""
        return np.arange(self.nodes) * (self.length / self.cells)

    @property
    def parts(self) -> np.ndarray:
        """The part w of the line that each node has, half of the cells at it, (nodes,)."""
        parts = np.full(self.nodes, self.length / self.cells)
        if not self.closed:
            parts[[0, -1]] *= 0.5
        return parts

    @property
    def rest_strain(self) -> np.ndarray:
        """The strain without force, (dim,), or of each cell, (cells, dim)."""
        strain = getattr(self.density.stored, "rest", np.zeros(self.target.dim))
        return strain.values if isinstance(strain, Each) else np.array(strain)

    def shape(self, u: Any = None, start: Any = None) -> np.ndarray:
        """The elements of a field with strain u, (nodes, ...): g_k+1 = g_k tau(l u_k).

        u : (dim,) or (cells, dim); as without force if left out.  start : the first element; the
        identity if left out.
        """
        name, n, dim = f"{type(self).__name__}.shape", self.cells, self.target.dim
        strain = self.rest_strain if u is None else real_array(u, f"{name}: u")
        check_finite(strain, f"{name}: u")
        if strain.shape not in ((dim,), (n, dim)):
            raise InvalidInput(f"{name}: u is ({dim},) or ({n}, {dim}); got shape {strain.shape}")
        h = np.asarray(self.retraction.tau(self.target, np.broadcast_to(strain, (n, dim)) * (self.length / n)))
        g = np.empty((self.nodes, *h.shape[1:]), h.dtype)
        g[0] = self.target.identity() if start is None else start
        for k in range(self.nodes - 1):
            g[k + 1] = self.target.compose(g[k], h[k])
        return g

    def at_rest(self, g: Any = None) -> Any:
        """The start of a field that does not move.  g : its elements, (nodes, ...); without force if left out."""
        return self.state(mu=np.zeros((self.nodes, self.target.dim)), g=self.shape() if g is None else g)

    def strains(self, g: Any) -> np.ndarray:
        """The strains of the cells, u = tau^-1(g_k^-1 g_k+1)/l, (..., cells, dim).  g : (..., nodes, ...)."""
        return self._displacements("strains", g)[2] * (self.cells / self.length)

    @closed_form_of("element")
    def stresses(self, g: Any) -> np.ndarray:
        """The internal forces dPhi/deta of the cells, (..., cells, dim).  g : (..., nodes, ...)."""
        stored, eta = self._stored(g)
        return np.asarray(stored.momentum(eta))

    def _stored(self, g: Any) -> tuple[Any, np.ndarray]:
        """Phi and the strains; where each cell has its own rest strain, these beyond it."""
        stored = self.density.stored
        if not isinstance(getattr(stored, "rest", None), Each):
            return stored, self.strains(g)
        return KineticEnergy(stored.stiffness), self.strains(g) - self.rest_strain

    def _displacements(self, name: str, g: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The elements at both ends of the cells, and x = tau^-1(g_a^-1 g_b), (..., cells, dim)."""
        first = real_array(g, f"{type(self).__name__}.{name}: g", or_complex=np.iscomplexobj(g))
        axis = -1 - len(self.target.element_shape)
        second = np.roll(first, -1, axis=axis)
        if not self.closed:
            first, second = (np.delete(x, -1, axis=axis) for x in (first, second))
        h = self.target.compose(self.target.inverse(first), second)
        return first, second, np.asarray(self.retraction.tau_inv(self.target, h))

    # ---------------------------------------------------------------- what flows through it

    def currents(self, g: Any) -> np.ndarray:
        """The momentum, in space, that flows through each cell in a unit of time towards larger s,
        (..., cells, dim): n = K_g lam, lam = -dPhi/deta carried to a node.  g : (..., nodes, ...).
        """
        first, _, x = self._displacements("currents", g)
        carried = self.retraction.dtau_inv_dual(self.target, -x, self.stresses(g))
        return -np.asarray(self.target.K(first, carried))

    def energy_currents(self, mu: Any, g: Any) -> np.ndarray:
        """The energy that flows through each cell in a unit of time towards larger s, (..., cells): the
        mean of <lam, xi> at its ends.  mu : (..., nodes, dim), g : (..., nodes, ...).
        """
        x, m = self._displacements("energy_currents", g)[2], self.stresses(g)
        xi = self.density.kinetic.gradient(real_array(mu, "energy_currents: mu") / self.parts[:, None])
        power = 0.0
        for y, at_end in ((-x, xi), (x, np.roll(xi, -1, axis=-2))):
            lam = -np.asarray(self.retraction.dtau_inv_dual(self.target, y, m))
            power = power + 0.5 * (lam * at_end[..., : self.cells, :]).sum(axis=-1)
        return np.asarray(power)

    def balance(self, run: Any) -> Drift:
        """How well momentum and energy of the nodes that are free change by what flows through the cells.

        run : by KickDrift(), with every step, of a field on whose nodes nothing else acts.  Momenta in space
        change by the currents at both ends of a step, to rounding; the energy, T and half of that of the cells
        at a node, to second order.
        """
        where = f"{type(self).__name__}.balance"
        if not self._alone:
            raise InvalidInput(f"{where}: more than the cells acts on nodes; give a field without")
        if not ({"mu", "g"} <= {*run.states} and run._at_every_step):
            raise InvalidInput(f"{where}: needs mu and g of every step of one run, every=1; got {[*run.states]}")
        mu, g, (stored, eta) = run.mu, run.g, self._stored(run.g)
        kinetic = self.parts * np.asarray(self.density.kinetic.energy(mu / self.parts[:, None]))
        energy = kinetic[..., None] + self._at_nodes(0.5 * self.length / self.cells * stored.value(eta)[..., None], 1.0)
        free = np.setdiff1d(np.arange(self.nodes), [node for nodes in self.held() for node in nodes])
        series, terms = {}, {}
        for name, contents, flow in (
            ("momentum of nodes", np.asarray(self.target.K(g, mu)), self.currents(g)),
            ("energy of nodes", energy, self.energy_currents(mu, g)[..., None]),
        ):
            out = self._at_nodes(flow, -1.0)
            steps = 0.5 * np.diff(run.t)[:, None, None] * (out[1:] + out[:-1])
            lost = np.cumsum(np.concatenate([0.0 * out[:1], steps]), axis=0)
            series[name], terms[name] = (contents + lost)[:, free], (np.abs(contents) + np.abs(lost))[:, free]
        return Drift.recorded(series, run.t, terms=terms)

    def _at_nodes(self, of_cells: np.ndarray, sign: float) -> np.ndarray:
        """Of each node what the cell after it has, and `sign` times what the cell before it has."""
        after = of_cells if self.closed else np.concatenate([of_cells, 0.0 * of_cells[:, :1]], axis=1)
        return after + sign * np.roll(after, 1, axis=1)

    def total_momentum(self, mu: Any, g: Any) -> np.ndarray:
        """The momentum of the whole field in space, sum_j K_g_j mu_j, (..., dim)."""
        return np.asarray(np.asarray(self.target.K(np.asarray(g), np.asarray(mu))).sum(axis=-2))

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The total momentum, where nothing holds and pulls.  states : mu, (..., nodes, dim), and g."""
        free = self._alone and not any(self.held())
        return {"momentum": self.total_momentum(states["mu"], states["g"])} if free else {}

    @property
    def _alone(self) -> bool:
        """Whether nothing but the cells acts on the nodes."""
        return len(self.potential.parts) == 1 and self.load is None

    @property
    def speeds(self) -> np.ndarray:
        """The speeds c of small waves near rest in the fastest cell, M c^2 v = C v, rising, (dim,); nan of what is unstable."""
        at, still = np.atleast_2d(self.rest_strain)[0], np.zeros(self.target.dim)
        of_cells: Any = self.density.stored.hessian(Vec.of(at))
        of_cells = of_cells.values if isinstance(of_cells, Each) else np.array(of_cells, dtype=float)[None]
        M = np.array(self.density.kinetic.hessian(Vec.of(still)), dtype=float)
        M, *of_cells = (np.diag(x) if x.ndim == 1 else x for x in (M, *of_cells))
        with np.errstate(invalid="ignore"):
            squares = np.sort(np.linalg.eigvals(np.linalg.solve(M, np.stack(of_cells))).real)
            return np.asarray(np.sqrt(squares).max(axis=0))

    @property
    def largest_step(self) -> float:  # type: ignore[override]
        """The longest stable step of KickDrift() near rest, in which the fastest wave crosses a cell."""
        fastest = np.nanmax(self.speeds, initial=0.0)
        return float(self.length / self.cells / fastest) if fastest else np.inf
