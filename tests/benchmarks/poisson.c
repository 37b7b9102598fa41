/* Poisson integrators of Lotka and Volterra's u' = u (v - p), v' = v (r - u), and Hamilton-Jacobi's on so(3)*: the steps of
   liemech in plain C.

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

/* Does the next correction vanish in rounding, judged by the last two, before[0] of the size before[1] and this one? */
static inline int settled(double change, double size, double before[2]) {
    int done = change <= 0x1p-52 * size;
    if (before[0] > 0.0) {
        double ratio = change / before[0];
        done |= (before[0] < before[1] && 16.0 * ratio * change <= 0x1p-52 * size) || (ratio >= 1.0 && change <= 0x1p-40 * size);
    }
    before[0] = change, before[1] = size;
    return done;
}

#define EXTRAPOLATED(n) for (int i = 0; i < n; i++) dS[i] = 3.0 * past[0][i] + (past[2][i] - 3.0 * past[1][i])
#define REMEMBER(n) for (int i = 0; i < n; i++) past[2][i] = past[1][i], past[1][i] = past[0][i], past[0][i] = dS[i]

void hamilton_jacobi(PARAMETERS) {
    double past[3][2] = {{0.0}};
    LOOP(
        double dS[2]; double change[2]; double before[2] = {0.0};
        EXTRAPOLATED(2);
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
            if (settled(off_by, size, before)) break;
        }
        REMEMBER(2);
        u += u * expm1(change[0]); v += v * expm1(change[1]);)
}

/* On so(3)*: H = sum K_i y_i^2/2 and y' = y x dH.  The numbers K_i, as the library reads them. */
double inverse[3] = {1.0, 1.0 / 1.5, 0.5};

static inline void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double polynomial(const double c[7], double x) {
    double x2 = x * x;
    return ((c[0] + c[1] * x) + x2 * (c[2] + c[3] * x)) + (x2 * x2) * ((c[4] + c[5] * x) + x2 * c[6]);
}

/* The mean x of y' = y x p from y over a unit of time, (dexp_p) y, and the change of y, x x p. */
static inline void turning(const double y[3], const double p[3], double x[3], double change[3]) {
    static const double c4[7] = {0.041666666666666664, -0.001388888888888889, 2.480158730158839e-05, -2.7557319224724247e-07,
                                 2.0876757146334453e-09, -1.1470719729895683e-11, 4.764673072706606e-14};
    static const double c5[7] = {0.008333333333333333, -0.0001984126984126984, 2.755731922398578e-06, -2.505210838524148e-08,
                                 1.6059043681290294e-10, -7.64710385181737e-13, 2.800217162164268e-15};
    double t2 = dot(p, p), b = 0.5 - t2 * polynomial(c4, t2), c = 1.0 / 6.0 - t2 * polynomial(c5, t2), w[3], ww[3];
    if (t2 > 0.4) {
        double t = sqrt(t2), half = sin(0.5 * t);
        b = 2.0 * half * half / t2, c = (t - sin(t)) / (t2 * t);
    }
    cross(p, y, w), cross(p, w, ww);
    for (int i = 0; i < 3; i++) x[i] = y[i] + (c * ww[i] - b * w[i]);
    cross(x, p, change);
}

static inline void gradient(const double x[3], double h, double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = h * (inverse[i] * x[i]);
}

static inline void covector_of_momenta(const double x[3], double h, double out[3]) {
    gradient(x, h, out);
#if ORDER == 4
    double w[3], a[3], turned[3], along[3], bent[3];
    cross(x, out, w), gradient(w, h, a);
    cross(out, a, turned), cross(x, a, along), gradient(along, h, bent);
    for (int i = 0; i < 3; i++) out[i] -= (1.0 / 12.0) * (bent[i] - turned[i]);
#endif
}

void momenta(PARAMETERS) {
    double past[3][3] = {{0.0}}, y[3] = {state[0], state[1], state[2]}, mass = fabs(y[0]) + fabs(y[1]) + fabs(y[2]);
    for (long n = 0; n < steps; n++) {
        double dS[3], x[3], change[3], before[2] = {0.0};
        EXTRAPOLATED(3);
        for (int tried = 0; tried < 50; tried++) {
            double there[3], moved[3], ab[3], bc[3], ca[3], off[3], step[3], m[3][3];
            turning(y, dS, x, change);
            covector_of_momenta(x, h, there);
            const double hat[3][3] = {{0.0, -x[2], x[1]}, {x[2], 0.0, -x[0]}, {-x[1], x[0], 0.0}}, along = 2.0 * dot(x, dS);
            for (int i = 0; i < 3; i++) off[i] = dS[i] - there[i];
            for (int i = 0; i < 3; i++) /* the columns m[j] of 1 - h K (hat x/2 + (2 x.p - x p^T - p x^T)/12) */
                for (int j = 0; j < 3; j++) {
                    double bent = (i == j) * along - (x[i] * dS[j] + dS[i] * x[j]);
                    m[j][i] = (i == j) - h * (inverse[i] * (0.5 * hat[i][j] + (1.0 / 12.0) * bent));
                }
            cross(m[1], m[2], bc), cross(m[2], m[0], ca), cross(m[0], m[1], ab);
            double scale = 1.0 / dot(m[0], bc);
            step[0] = scale * dot(off, bc), step[1] = scale * dot(off, ca), step[2] = scale * dot(off, ab);
            cross(x, step, moved);
            double size = mass + fabs(change[0]) + fabs(change[1]) + fabs(change[2]);
            for (int i = 0; i < 3; i++) dS[i] -= step[i];
            if (settled(fabs(moved[0]) + fabs(moved[1]) + fabs(moved[2]), size, before)) break;
        }
        REMEMBER(3);
        turning(y, dS, x, change);
        for (int i = 0; i < 3; i++) y[i] += change[i];
        mass = fabs(y[0]) + fabs(y[1]) + fabs(y[2]);
    }
    for (int i = 0; i < 3; i++) state[i] = y[i];
}
