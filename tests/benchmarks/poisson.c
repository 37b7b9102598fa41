/* Poisson integrators of Lotka and Volterra's u' = u (v - p), v' = v (r - u): the steps of liemech in plain C.

   The coefficients come as constants: -DSTAGES=..., -DGAMMA=... (of a composition), -DKICKS=..., -DDRIFTS=... (of a splitting). */

#include <math.h>

static const double shares[] = {GAMMA}, kicks[STAGES + 1] = {KICKS}, drifts[STAGES] = {DRIFTS};

static inline void u_first(double *u, double *v, const double r, const double p, double h) {
    double slope = h * (1.0 - p / *v);
    *u += slope * (*u * *v) / (1.0 - slope * *v);
    *v -= h * (*u * *v) * (1.0 - r / *u);
}

static inline void v_first(double *u, double *v, const double r, const double p, double h) {
    double slope = -h * (1.0 - r / *u);
    *v += slope * (*u * *v) / (1.0 - slope * *u);
    *u += h * (*u * *v) * (1.0 - p / *v);
}

#define PARAMETERS double *state, double r, double p, double h, long steps
#define LOOP(body)                                  \
    double u = state[0], v = state[1];              \
    for (long n = 0; n < steps; n++) { body }       \
    state[0] = u, state[1] = v;

void euler(PARAMETERS) { LOOP(u_first(&u, &v, r, p, h);) }

void verlet(PARAMETERS) {
    LOOP(_Pragma("GCC unroll 32") for (unsigned i = 0; i < sizeof shares / sizeof *shares; i++) {
        u_first(&u, &v, r, p, 0.5 * (shares[i] * h));
        v_first(&u, &v, r, p, 0.5 * (shares[i] * h));
    })
}

void splitting(PARAMETERS) {
    LOOP(_Pragma("GCC unroll 32") for (int i = 0; i <= STAGES; i++) {
        if (kicks[i] != 0.0) u = u * exp((kicks[i] * h * (1.0 - p / v)) * v);
        if (i < STAGES && drifts[i] != 0.0) v = v * exp(-((drifts[i] * h * (1.0 - r / u)) * u));
    })
}
