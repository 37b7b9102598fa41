"""Constrained systems: q' = dH/dp, p' = -dH/dq - G(q)^T lambda with g(q) = 0, in R^n and on Lie groups.

In the order in which one reads:

    constraint.py               conditions on where bodies are
    constrained.py              canonical systems under conditions, and their multipliers
    constrained_body.py         bodies on a group under conditions; conditions.py adds up and eliminates them
    constrained_parts.py        energies whose parts move on the conditions in closed form
    rattle.py, lobatto_pair.py  symplectic methods in R^n; on_constraints.py says which systems they take
    lie_rattle.py               RATTLE on a group; nonholonomic.py for conditions on velocities
    geodesic_splitting.py       kicks, and motions along geodesics
    index_reduction.py          the equation without constraints that the multipliers give
"""
