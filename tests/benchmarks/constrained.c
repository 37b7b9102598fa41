/* RATTLE on the spherical pendulum and on the planar double pendulum in plain C: the steps of liemech, Newton's method by the same
   rule (a residual below 2^-30 of the terms, then one more correction), multipliers extrapolated from the last three steps.
   With CHECKED a step looks at what liemech looks at too: has Newton's method converged, are the constraints independent, is it the
   branch that begins at h = 0, are all numbers finite; if not, the run stops where it stood before the step.
   advance_closed: on the sphere, with the multiplier as the smaller root of its quadratic equation. */

#include <math.h>

#define TOLERANCE (1.0 / 1073741824.0)
#define FAR (1.0 / 262144.0)
#define INDEPENDENT (1.0 / 1099511627776.0)
#define FOLD (1.0 / 16.0)

static inline double dot(const double *a, const double *b, int n) {
    double total = 0.0;
    for (int i = 0; i < n; i++) total += a[i] * b[i];
    return total;
}

static inline double sizes(const double *a, const double *b, int n) {
    double total = 0.0;
    for (int i = 0; i < n; i++) total += fabs(a[i]) * fabs(b[i]);
    return total;
}

/* A step is good if its pivots have the signs they had and are about as large, and if all numbers are finite. */
static inline int good(const double *now, const double *then, int m, const double *q, const double *p, int n) {
    double total = 0.0;
    for (int i = 0; i < n; i++) total += q[i] + p[i];
    int fine = total - total == 0.0;
    for (int k = 0; k < m; k++) {
        const double a = fabs(now[k]), b = fabs(then[k]);
        fine = fine && now[k] * then[k] > 0.0 && !(b < FOLD * a) && !(a < FOLD * b);
    }
    return fine;
}

/* parameters: mass, length, gravity */
void advance_sphere(double *s, const double *parameters, double h, long steps) {
    const double m = parameters[0], l = parameters[1], g = parameters[2], over_m = 1.0 / m, over_l = 1.0 / l;
    double q[3] = {s[0], s[1], s[2]}, p[3] = {s[3], s[4], s[5]};
    double start = 0.5 * (dot(p, p, 3) * over_m - m * g * q[2]) / l, last = start, last_1 = start, last_2 = start;
    for (long n = 0; n < steps; n++) {
        double x = 3.0 * last + (last_2 - 3.0 * last_1), G[3], N[3], aim[3], q1[3], ph[3], unit = 0.0, r = 0.0;
        const double q0[3] = {q[0], q[1], q[2]}, p0[3] = {p[0], p[1], p[2]};
        const double free[3] = {p[0], p[1], p[2] - 0.5 * h * m * g};
        for (int i = 0; i < 3; i++) {
            const double drift = h * over_m * free[i];
            G[i] = q[i] * over_l, N[i] = h * h * over_m * G[i], aim[i] = q[i] + drift;
            unit += fabs(G[i]) * (fabs(drift - x * N[i]) + FAR * fabs(q[i]));
        }
        for (int k = 0; k < 50; k++) {
            for (int i = 0; i < 3; i++) q1[i] = aim[i] - x * N[i];
            r = 0.5 * over_l * ((q1[2] * q1[2] - l * l) + (q1[0] * q1[0] + q1[1] * q1[1]));
            x -= r / (-over_l * dot(q1, N, 3));
            if (fabs(r) <= TOLERANCE * unit) break;
        }
        for (int i = 0; i < 3; i++) ph[i] = free[i] - h * x * G[i], q[i] = aim[i] - x * N[i];
        ph[2] -= 0.5 * h * m * g;
        const double pivot = dot(q, q, 3), y = dot(q, ph, 3) / pivot;
        for (int i = 0; i < 3; i++) p[i] = ph[i] - y * q[i];
        if (CHECKED) {
            const double then = dot(q, q0, 3);
            if (!(fabs(r) <= TOLERANCE * unit) || !good(&pivot, &then, 1, q, p, 3)) {
                for (int i = 0; i < 3; i++) q[i] = q0[i], p[i] = p0[i];
                break;
            }
        }
        last_2 = last_1, last_1 = last, last = x;
    }
    for (int i = 0; i < 3; i++) s[i] = q[i], s[3 + i] = p[i];
}

void advance_closed(double *s, const double *parameters, double h, long steps) {
    const double m = parameters[0], l = parameters[1], g = parameters[2], over_m = 1.0 / m, f = 0.5 * h * m * g;
    double q[3] = {s[0], s[1], s[2]}, p[3] = {s[3], s[4], s[5]};
    for (long n = 0; n < steps; n++) {
        double d[3], free[3], half[3];
        for (int i = 0; i < 3; i++) d[i] = h * over_m * (p[i] - (i == 2 ? f : 0.0)), free[i] = q[i] + d[i];
        const double b = dot(q, free, 3), a = dot(q, q, 3), c = (a - l * l) + 2.0 * dot(q, d, 3) + dot(d, d, 3);
        const double x = c / (b + sqrt(b * b - a * c));
        for (int i = 0; i < 3; i++) {
            const double there = free[i] - x * q[i];
            half[i] = m / h * (d[i] - x * q[i]) - (i == 2 ? f : 0.0), q[i] = there;
        }
        const double y = dot(q, half, 3) / dot(q, q, 3);
        for (int i = 0; i < 3; i++) p[i] = half[i] - y * q[i];
    }
    for (int i = 0; i < 3; i++) s[i] = q[i], s[3 + i] = p[i];
}

/* parameters: two masses, two lengths, gravity */
static inline void rods(const double *q, const double *over_l, double G[2][4]) {
    for (int k = 0; k < 2; k++) {
        const double first = q[k] * over_l[0], second = (q[2 + k] - q[k]) * over_l[1];
        G[0][k] = first, G[0][2 + k] = 0.0, G[1][k] = -second, G[1][2 + k] = second;
    }
}

static inline void products(double G[2][4], double N[2][4], double S[2][2]) {
    S[0][0] = G[0][0] * N[0][0] + G[0][1] * N[0][1], S[0][1] = G[0][0] * N[1][0] + G[0][1] * N[1][1];
    S[1][0] = G[1][0] * N[0][0] + G[1][1] * N[0][1], S[1][1] = dot(G[1], N[1], 4);
}

static inline void solve(double S[2][2], const double *r, double *x) {
    const double scale = 1.0 / (S[0][0] * S[1][1] - S[0][1] * S[1][0]);
    x[0] = scale * (S[1][1] * r[0] - S[0][1] * r[1]), x[1] = scale * (S[0][0] * r[1] - S[1][0] * r[0]);
}

void advance_chain(double *s, const double *parameters, double h, long steps, const double *guess) {
    const double *m = parameters, *l = parameters + 2, g = parameters[4];
    const double w[4] = {1.0 / m[0], 1.0 / m[0], 1.0 / m[1], 1.0 / m[1]}, over_l[2] = {1.0 / l[0], 1.0 / l[1]};
    const double f[4] = {0.0, -0.5 * h * m[0] * g, 0.0, -0.5 * h * m[1] * g};
    double q[4], p[4], last[2], last_1[2], last_2[2], G[2][4], N[2][4], T[2][4], S[2][2];
    for (int i = 0; i < 4; i++) q[i] = s[i], p[i] = s[4 + i];
    for (int k = 0; k < 2; k++) last[k] = last_1[k] = last_2[k] = 0.5 * guess[k];
    rods(q, over_l, G);
    for (long n = 0; n < steps; n++) {
        double x[2], unit[2] = {0.0, 0.0}, free[4], aim[4], ph[4], q1[4], r[2], c[2], G0[2][4], size = 0.0;
        const double q0[4] = {q[0], q[1], q[2], q[3]}, p0[4] = {p[0], p[1], p[2], p[3]};
        for (int k = 0; k < 2; k++) x[k] = 3.0 * last[k] + (last_2[k] - 3.0 * last_1[k]);
        for (int i = 0; i < 4; i++) {
            free[i] = p[i] + f[i];
            const double drift = h * w[i] * free[i];
            for (int k = 0; k < 2; k++) N[k][i] = h * h * w[i] * G[k][i];
            const double d = fabs(drift - (x[0] * N[0][i] + x[1] * N[1][i])) + FAR * fabs(q[i]);
            for (int k = 0; k < 2; k++) unit[k] += fabs(G[k][i]) * d;
            aim[i] = q[i] + drift;
        }
        for (int it = 0; it < 50; it++) {
            for (int i = 0; i < 4; i++) q1[i] = aim[i] - (x[0] * N[0][i] + x[1] * N[1][i]);
            rods(q1, over_l, T);
            products(T, N, S);
            const double a = q1[2] - q1[0], b = q1[3] - q1[1];
            r[0] = 0.5 * over_l[0] * ((q1[1] * q1[1] - l[0] * l[0]) + q1[0] * q1[0]);
            r[1] = 0.5 * over_l[1] * ((b * b - l[1] * l[1]) + a * a);
            solve(S, r, c);
            x[0] += c[0], x[1] += c[1];
            const double u = r[0] / unit[0], v = r[1] / unit[1];
            size = u * u + v * v;
            if (size <= TOLERANCE * TOLERANCE) break;
        }
        for (int i = 0; i < 4; i++) {
            q[i] = aim[i] - (x[0] * N[0][i] + x[1] * N[1][i]);
            ph[i] = free[i] - h * (x[0] * G[0][i] + x[1] * G[1][i]) + f[i];
        }
        if (CHECKED) for (int k = 0; k < 2; k++) for (int i = 0; i < 4; i++) G0[k][i] = w[i] * G[k][i];
        rods(q, over_l, G);
        for (int k = 0; k < 2; k++) {
            r[k] = 0.0;
            for (int i = 0; i < 4; i++) N[k][i] = w[i] * G[k][i], r[k] += N[k][i] * ph[i];
        }
        products(G, N, S);
        solve(S, r, c);
        for (int i = 0; i < 4; i++) p[i] = ph[i] - (c[0] * G[0][i] + c[1] * G[1][i]);
        if (CHECKED) {
            double B[2][2];
            products(G, G0, B);
            const double now[2] = {S[0][0], (S[0][0] * S[1][1] - S[0][1] * S[1][0]) / S[0][0]};
            const double then[2] = {B[0][0], (B[0][0] * B[1][1] - B[0][1] * B[1][0]) / B[0][0]};
            const int apart = now[0] > INDEPENDENT * sizes(G[0], N[0], 2) && now[1] > INDEPENDENT * sizes(G[1], N[1], 4);
            if (!(size <= TOLERANCE * TOLERANCE) || !apart || !good(now, then, 2, q, p, 4)) {
                for (int i = 0; i < 4; i++) q[i] = q0[i], p[i] = p0[i];
                break;
            }
        }
        for (int k = 0; k < 2; k++) last_2[k] = last_1[k], last_1[k] = last[k], last[k] = x[k];
    }
    for (int i = 0; i < 4; i++) s[i] = q[i], s[4 + i] = p[i];
}
