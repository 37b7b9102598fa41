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

/* Numbers that the Hamilton-Jacobi step reads, as the library does: of H = sum (d_i y_i - p_i log y_i), and of the bracket. */
double weights[2] = {1.0, 1.0}, coupling[2][2] = {{0.0, 1.0}, {-1.0, 0.0}};

static inline void sharp(const double a[2], double out[2]) {
    for (int i = 0; i < 2; i++) out[i] = coupling[i][0] * a[0] + coupling[i][1] * a[1];
}

/* The covector dS of the method of order ORDER, where the numbers are d_i y_i = n_i. */
static inline void covector(const double n[2], double r, double p, double h, double out[2]) {
    out[0] = h * (n[0] - r), out[1] = h * (n[1] - p);
#if ORDER == 4
    double w[2], a[2], bent[2];
    sharp(out, w);
    for (int i = 0; i < 2; i++) a[i] = h * (n[i] * w[i]);
    sharp(a, bent);
    for (int i = 0; i < 2; i++) out[i] += (1.0 / 12.0) * (0.5 * (h * (n[i] * w[i] * w[i])) - h * (n[i] * bent[i]));
#endif
}

void hamilton_jacobi(PARAMETERS) {
    double past[3][2] = {{0.0}};
    LOOP(
        double dS[2]; double change[2]; double before = 0.0;
        for (int i = 0; i < 2; i++) dS[i] = 3.0 * past[0][i] + (past[2][i] - 3.0 * past[1][i]);
        sharp(dS, change);
        for (int tried = 0; tried < 50; tried++) {
            double n[2] = {weights[0] * (u * exp(0.5 * change[0])), weights[1] * (v * exp(0.5 * change[1]))};
            double there[2]; double moved[2]; double m[2][2];
            covector(n, r, p, h, there);
            for (int i = 0; i < 2; i++)
                for (int j = 0; j < 2; j++) m[i][j] = (i == j) + (0.5 * h) * (coupling[j][i] * n[i]);
            double off[2] = {dS[0] - there[0], dS[1] - there[1]};
            double scale = 1.0 / (m[0][0] * m[1][1] - m[0][1] * m[1][0]);
            double step[2] = {scale * (m[1][1] * off[0] - m[0][1] * off[1]), scale * (m[0][0] * off[1] - m[1][0] * off[0])};
            sharp(step, moved);
            double off_by = fabs(moved[0]) + fabs(moved[1]); double size = 1.0 + fabs(change[0]) + fabs(change[1]);
            dS[0] -= step[0]; dS[1] -= step[1];
            sharp(dS, change);
            int done = off_by <= 0x1p-52 * size;
            if (before > 0.0) done |= 16.0 * (off_by / before) * off_by <= 0x1p-52 * size;
            before = off_by;
            if (done) break;
        }
        for (int i = 0; i < 2; i++) past[2][i] = past[1][i], past[1][i] = past[0][i], past[0][i] = dS[i];
        u += u * expm1(change[0]); v += v * expm1(change[1]);)
}
