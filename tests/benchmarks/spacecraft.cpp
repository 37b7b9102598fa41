// A hub in orbit about a point mass: place, velocity, angular velocity in the body, quaternion; the classical Runge-Kutta
// method.  r : momentum of wheels that turn at constant momentum, in the body.
#include <cmath>

struct State { double a[13]; };

static inline State rate(const State& y, const double* J, const double* iJ, const double* r, double k) {
    const double *x = y.a, *v = y.a + 3, *w = y.a + 6, *q = y.a + 9;
    double s = x[0] * x[0] + x[1] * x[1] + x[2] * x[2], f = -k / (s * std::sqrt(s));
    double L0 = J[0] * w[0] + r[0], L1 = J[1] * w[1] + r[1], L2 = J[2] * w[2] + r[2];
    return {{v[0], v[1], v[2], f * x[0], f * x[1], f * x[2],
        (L1 * w[2] - L2 * w[1]) * iJ[0], (L2 * w[0] - L0 * w[2]) * iJ[1], (L0 * w[1] - L1 * w[0]) * iJ[2],
        -.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]), .5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
        .5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]), .5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])}};
}

static inline State along(const State& y, double h, const State& k) {
    State z;
    for (int i = 0; i < 13; ++i) z.a[i] = y.a[i] + h * k.a[i];
    return z;
}

extern "C" void hub(double* io, const double* J, const double* r, double k, double h, long steps) {
    State y;
    for (int i = 0; i < 13; ++i) y.a[i] = io[i];
    double iJ[3] = {1 / J[0], 1 / J[1], 1 / J[2]};
    for (long n = 0; n < steps; ++n) {
        State a = rate(y, J, iJ, r, k), b = rate(along(y, .5 * h, a), J, iJ, r, k);
        State c = rate(along(y, .5 * h, b), J, iJ, r, k), d = rate(along(y, h, c), J, iJ, r, k);
        for (int i = 0; i < 13; ++i) y.a[i] += h / 6 * (a.a[i] + 2 * (b.a[i] + c.a[i]) + d.a[i]);
    }
    for (int i = 0; i < 13; ++i) io[i] = y.a[i];
}
