/* Poisson integrators of Lotka and Volterra's u' = u (v - p), v' = v (r - u): the steps of liemech in plain C.

   The coefficients come as constants: -DSTAGES=..., -DGAMMA=... (of a composition), -DKICKS=..., -DDRIFTS=... (of a splitting),
   -DORDER=... (of a Hamilton-Jacobi method). */

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
#define LOOP(...)                                   \
    double u = state[0], v = state[1];              \
    for (long n = 0; n < steps; n++) { __VA_ARGS__ } \
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

/* The covector dS of the Hamilton-Jacobi method, of order ORDER, at x, the logarithms of the numbers over u and v. */
static inline void covector(double u, double v, const double x[2], double r, double p, double h, double out[2]) {
    double eu = u * exp(x[0]), ev = v * exp(x[1]), a = h * (eu - r), b = h * (ev - p);
    out[0] = a, out[1] = b;
#if ORDER == 4
    double bent[2] = {h * (eu * b), h * (ev * -a)};
    out[0] += (1.0 / 12.0) * (0.5 * (h * (eu * b * b)) - h * (eu * bent[1]));
    out[1] += (1.0 / 12.0) * (0.5 * (h * (ev * a * a)) + h * (ev * bent[0]));
#endif
}

void hamilton_jacobi(PARAMETERS) {
    double past[3][2] = {{0.0}};
    LOOP(
        double mean[2]; double dS[2]; double before = 0.0;
        for (int i = 0; i < 2; i++) mean[i] = 3.0 * past[0][i] + (past[2][i] - 3.0 * past[1][i]);
        for (int tried = 0; tried < 50; tried++) {
            covector(u, v, mean, r, p, h, dS);
            double off[2] = {mean[0] - 0.5 * dS[1], mean[1] + 0.5 * dS[0]};
            double by_v = -0.5 * h * (v * exp(mean[1])); double by_u = 0.5 * h * (u * exp(mean[0]));
            double scale = 1.0 / (1.0 - by_v * by_u);
            double step[2] = {scale * (off[0] - by_v * off[1]), scale * (off[1] - by_u * off[0])};
            double change = fabs(step[0]) / (1.0 + fabs(dS[1])) + fabs(step[1]) / (1.0 + fabs(dS[0]));
            mean[0] -= step[0]; mean[1] -= step[1];
            int done = change <= 0x1p-52;
            if (before > 0.0) done |= 16.0 * (change / before) * change <= 0x1p-52;
            before = change;
            if (done) break;
        }
        covector(u, v, mean, r, p, h, dS);
        for (int i = 0; i < 2; i++) past[2][i] = past[1][i], past[1][i] = past[0][i];
        past[0][0] = 0.5 * dS[1]; past[0][1] = -0.5 * dS[0];
        u += u * expm1(dS[1]); v += v * expm1(-dS[0]);)
}
