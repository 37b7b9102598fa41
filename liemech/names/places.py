"""Where modules are that were in another place: what files, pickles and programs name by the former one is found."""

import ast
import functools
import sys
from typing import Any

LIBRARY = __name__.partition(".")[0]
NAMESPACES = "actions", "charts", "class_functions", "loops", "neighbours", "parts", "structures", "time_scales"
"""Those that are no folders: their public names come from several, by the stubs beside this file."""

MOVED = """
formulas > formulas.calls: arguments batches broadcasting lanes one_row
formulas > formulas.classes: annotations derived fields frozen of_each overriding pytree=layouts records remembered
formulas > formulas.classes: signatures taken_back
formulas.classes > formulas.classes: flattening=layouts nested=records pytree=layouts
formulas > formulas.numbers: anything compensated complex_numbers double_double dual philox products series
formulas > formulas.numbers: series_of_sites sizes ways
. > groups: retractions
groups > groups.composed: algebra_of_parts=parts one_of opposite power product same_elements semidirect species
groups > groups.matrices: casimir_polynomials classical heisenberg matrix_algebra matrix_arrays matrix_basis
groups > groups.matrices: matrix_functions matrix_group matrix_invariants nearest skew_matrices
groups > groups.rigid: rotation_coefficients rotation_logarithm se2 se23 se3 sgal3 so3 stumpff
groups > groups.rigid: unit_quaternions
integrators > integrators.free_body: exact_free_body isospectral_matrices midpoint moser_veselov splitting
integrators > integrators.kicks: explicit_kicks kick_drift lie_verlet multiple_time_steps
models > joints: body_forces given_motion joint_forces joint_motion joints link linkage linked_joints mounting
models > joints: rolling urdf
integrators > joints.in_memory: multiple_time_steps_of_links rattle_of_links
integrators > joints.in_memory: rkmk_of_links=reduced_equation taylor_of_links
simulation.sites > joints.in_memory: links=runs
models > models.bodies: carlson exact_rigid_body exact_top gravity heavy_top jacobi kirchhoff
models > models.bodies: manakov_body orthogonal_body poisson_top polhode rigid_body
models > models.lattices: bloch_iserles lotka_volterra maxwell_bloch toda toda_flow viscous_sphere von_neumann
models > models.lattices: zeitlin_sphere
models > models.many: cosserat_rod fermi_pasta_ulam mutual_gravity rod_section rod_statics sites water
models > models.planets: decimals exact_kepler henon_heiles kepler n_body planetary_system universal_variables
models > models.space: effectors reaction_wheels space_bodies space_fields space_forces spacecraft
models > systems: inertia
models > models.swinging: andrews constrained_pendulums exact_pendulum frames pendulums surfaces
simulation > rooms: at_work derivatives fictive_time files
simulation.at_work > rooms.at_work: command_blocks export measured_orders spread stepper
systems > rooms.at_work: ramp=command_blocks
rooms.at_work > rooms.at_work: ramp=command_blocks
integrators > rooms.constraints: geodesic_splitting index_reduction lie_rattle lobatto_pair nonholonomic
integrators > rooms.constraints: on_constraints rattle
systems > rooms.constraints: conditions constrained constrained_body constrained_parts constraint
integrators > rooms.derivatives: backward=steps_backwards
simulation.derivatives > rooms.derivatives: blocks bridges gradient losses reversal tangent varied
simulation.derivatives > rooms.derivatives: varied_input
simulation.derivatives.of_sites > rooms.derivatives.of_sites: adaptive adjoint backward parameters pullback
simulation.derivatives.of_sites > rooms.derivatives.of_sites: tangent
integrators > rooms.fictive_time: adaptive_verlet reversible_controller
simulation > rooms.fictive_time: origin
simulation.fictive_time > rooms.fictive_time: arrival run=runs
systems > rooms.fictive_time: clocked sundman time_scales time_transformed
simulation.files > rooms.files: archive arrays encoding fingerprints labelled
integrators > rooms.hamilton_jacobi: class_functions derivability hamilton_jacobi lie_poisson_first_kind
integrators > rooms.hamilton_jacobi: lie_poisson_hj
integrators > rooms.noise: dissipative_splitting stochastic_steps
systems > rooms.noise: dissipative double_bracket stochastic
integrators > rooms.poisson: boris darboux_lie discrete_gradient poisson_euler
systems > rooms.poisson: canonical_transformation darboux local_coordinates metriplectic poisson
rooms.published > rooms.published.rods: bend elastica spaghetti
integrators > rooms.sites: galerkin_of_chain sublattices=spin_splittings
simulation > rooms.sites: sites=runs
systems > rooms.sites: colouring energy_of_species graphs separable_sites sublattices=parts_of_spins
simulation.sites > rooms.sites.runs: between chains driver events execution lists plan prepared=shape run states
simulation.sites > rooms.sites.runs: totals turns
rooms.sites.runs > rooms.sites.runs: prepared=shape
systems > rooms.sites.terms: among bound_terms kinds_of_terms near_pairs point_terms
systems > rooms.sites.terms: sums_of_terms terms terms_at_site terms_in_arrays trials_of_terms
simulation > simulation.runs: carry course equal going_on jumps run short starts tolerance
systems > systems: multirate=separable
systems > systems.equations: group_equation homogeneous_equation isospectral_flow
systems > systems.in_time: driven driven_hamiltonian driven_kinetic_energy tabulated varied_table
systems > systems.many: common_momentum site_state
"""
# former package > package of today: modules that went from one to the other, with `=` under another name

CLASSES = {
    "joints.in_memory.links:Links": "joints.in_memory.links:LinkedBodies",
    "models.lattices.lotka_volterra:Species": "models.lattices.lotka_volterra:SpeciesEnergy",
    "models.many.fermi_pasta_ulam:Spring": "models.many.fermi_pasta_ulam:BentSpring",
    "rooms.sites.terms.kinds_of_terms:Kind": "rooms.sites.terms.bound_terms:Kind",
    "systems.equations.group_equation:Position": "systems.equations.group_equation:GroupState",
}
"""Classes with another name, or in another module than before, by the former name in the module of today."""


@functools.cache
def moved() -> dict[str, str]:
    """The module of today by its former name, both relative to the library."""
    modules = {}
    for line in MOVED.split("\n")[1:-1]:
        path, _, names = line.partition(":")
        former, _, now = path.partition(" > ")
        for old, _, new in (name.partition("=") for name in names.split()):
            modules[f"{former}.{old}".lstrip(".")] = f"{now}.{new or old}"
    return modules


def place_of(module: str) -> str:
    """The full name of a module today, by a name that it has had."""
    home, _, path = module.partition(".")
    return f"{LIBRARY}.{moved()[path]}" if home == LIBRARY and path in moved() else module


def class_of(path: str) -> str:
    """The full name `module:class` of a class today, by a name that it has had."""
    module, _, name = path.partition(":")
    home, _, path_inside = f"{place_of(module)}:{name}".partition(".")
    return f"{home}.{CLASSES.get(path_inside, path_inside)}" if home == LIBRARY else path


def package_of(namespace: str) -> str:
    """The package from which the stub of a namespace imports."""
    home, _, name = namespace.rpartition(".")
    return f"{LIBRARY}.names" if home == LIBRARY and name in NAMESPACES else namespace


@functools.cache
def stub_of(namespace: str) -> ast.Module:
    """The stub of a namespace, parsed."""
    package = package_of(namespace)
    spec: Any = sys.modules[package].__spec__
    path = spec.origin.replace(
        "__init__.py", "__init__.pyi" if package == namespace else f"{namespace.rpartition('.')[2]}.pyi"
    )
    return ast.parse(spec.loader.get_data(path))
