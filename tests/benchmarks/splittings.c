/* Splittings of T(p) + V(q) in the plane, p += b_i h f(q), q += a_i h p: the steps of liemech's Splitting, in plain C.

   The coefficients come as constants: -DSTAGES=..., -DKICKS=..., -DDRIFTS=..., -DCARRIES=0 or 1. */

#include <math.h>

static const double kicks[STAGES + 1] = {KICKS}, drifts[STAGES] = {DRIFTS};

static inline void kepler(double attraction, const double q[2], double f[2]) {
    double square = q[0] * q[0] + q[1] * q[1], factor = -attraction / (square * sqrt(square));
    f[0] = factor * q[0], f[1] = factor * q[1];
}

static inline void galaxy(double coupling, const double q[2], double f[2]) {
    double x = q[0], y = q[1];
    f[0] = -(x + 2.0 * coupling * x * y), f[1] = -(y + coupling * (x * x - y * y));
}

#define ADVANCE(name, force)                                              \
    void advance_##name(double *state, double parameter, double h, long steps) { \
        double q[2] = {state[0], state[1]}, p[2] = {state[2], state[3]}, f[2]; \
        if (CARRIES) force(parameter, q, f);                                         \
        for (long n = 0; n < steps; n++) {                                \
            _Pragma("GCC unroll 32") for (int i = 0; i <= STAGES; i++) {  \
                if (kicks[i] != 0.0) {                                    \
                    if (i > 0 || !CARRIES) force(parameter, q, f);                   \
                    p[0] += (kicks[i] * h) * f[0], p[1] += (kicks[i] * h) * f[1]; \
                }                                                         \
                if (i < STAGES) q[0] += (drifts[i] * h) * p[0], q[1] += (drifts[i] * h) * p[1]; \
            }                                                             \
        }                                                                 \
        state[0] = q[0], state[1] = q[1], state[2] = p[0], state[3] = p[1]; \
    }

ADVANCE(kepler, kepler)
ADVANCE(galaxy, galaxy)
