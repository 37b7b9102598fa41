// Cosserat rods by an explicit variational Verlet method in C++; rotations by polynomials below one radian.
#include <cmath>
struct V { double x, y, z; };
static inline V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
static inline double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
struct M { double a[9]; };                                         // row by row
static inline V operator*(const M& m, V v) { return {m.a[0] * v.x + m.a[1] * v.y + m.a[2] * v.z, m.a[3] * v.x + m.a[4] * v.y + m.a[5] * v.z, m.a[6] * v.x + m.a[7] * v.y + m.a[8] * v.z}; }
static inline V tmul(const M& m, V v) { return {m.a[0] * v.x + m.a[3] * v.y + m.a[6] * v.z, m.a[1] * v.x + m.a[4] * v.y + m.a[7] * v.z, m.a[2] * v.x + m.a[5] * v.y + m.a[8] * v.z}; }
static inline M operator*(const M& a, const M& b) { M c; for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) c.a[3 * i + j] = a.a[3 * i] * b.a[j] + a.a[3 * i + 1] * b.a[3 + j] + a.a[3 * i + 2] * b.a[6 + j]; return c; }
// sin(t)/t and (1 - cos t)/t^2 of t^2 = x, to rounding for t below 1.3
static inline void rodrigues(double x, double& s, double& c) {
    s = 1 + x * (-1. / 6 + x * (1. / 120 + x * (-1. / 5040 + x * (1. / 362880 + x * (-1. / 39916800 + x * (1. / 6227020800. + x * (-1. / 1307674368000. + x * (1. / 355687428096000.))))))));
    c = .5 + x * (-1. / 24 + x * (1. / 720 + x * (-1. / 40320 + x * (1. / 3628800 + x * (-1. / 479001600. + x * (1. / 87178291200. + x * (-1. / 20922789888000. + x * (1. / 6402373705728000.))))))));
}
static inline M rotation(V w) {
    double s, c; rodrigues(dot(w, w), s, c);
    double xx = c * w.x * w.x, yy = c * w.y * w.y, zz = c * w.z * w.z, xy = c * w.x * w.y, xz = c * w.x * w.z, yz = c * w.y * w.z;
    return {{1 - yy - zz, xy - s * w.z, xz + s * w.y, xy + s * w.z, 1 - xx - zz, yz - s * w.x, xz - s * w.y, yz + s * w.x, 1 - xx - yy}};
}
// Cosserat rods, what the rods of this library are compared with: nodes x in R^3, frames R of the segments between them in SO(3); explicit variational Verlet.
// V = sum l/2 sigma.S sigma + sum l/2 kappa.B kappa,  sigma = R^T dx/l - e3,  l kappa = cay^-1(R_k^T R_(k+1)).
// Kick by the exact forces, drift by the exact flow of free symmetric tops.  Also: one Newton iteration's worth of 6 x 6 blocks.
#include <vector>
struct Rod { long n; double l; V S, B; double I1, I3; std::vector<double> im; std::vector<V> x, v, L, f, t; std::vector<M> R; };
static double forces(Rod& r, bool want) {                          // f on nodes, t on frames in space axes
    double E = 0; const double il = 1 / r.l;
    for (auto& f : r.f) f = V{0, 0, 0};
    V carry{0, 0, 0}, ahead{0, 0, 0};
    for (long k = 0; k < r.n; ++k) {
        const M& R = r.R[k]; V d = tmul(R, r.x[k + 1] - r.x[k]), s = il * d - V{0, 0, 1}, n{r.S.x * s.x, r.S.y * s.y, r.S.z * s.z};
        V t = cross(d, n), N = R * n;
        r.f[k] = N - carry; carry = N;                             // force on node k: N_k - N_(k-1)
        if (want) E += .5 * r.l * dot(s, n);
        t = t + ahead;
        if (k + 1 < r.n) {
            const M& Q = r.R[k + 1]; M D;                          // R_k^T R_(k+1)
            for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) D.a[3 * i + j] = R.a[i] * Q.a[j] + R.a[3 + i] * Q.a[3 + j] + R.a[6 + i] * Q.a[6 + j];
            double q = 2 / (1 + D.a[0] + D.a[4] + D.a[8]);
            V c{q * (D.a[7] - D.a[5]), q * (D.a[2] - D.a[6]), q * (D.a[3] - D.a[1])};       // 2 tan(angle/2) axis
            V m{il * r.B.x * c.x, il * r.B.y * c.y, il * r.B.z * c.z};
            if (want) E += .5 * dot(m, c);
            V h = .5 * cross(c, m), a = m + .25 * dot(c, m) * c;
            t = t + (a - h);                                       // seen from k; from k + 1 it is -(a + h) in its own axes
            ahead = V{0, 0, 0} - (a + h);
        } else ahead = V{0, 0, 0};
        r.t[k] = R * t;
    }
    r.f[r.n] = V{0, 0, 0} - carry;
    return E;
}
// segments n, rest length l, moduli S, B, node masses m, frame moments (I1, I1, I3); clamp: first node and frame held; load on the last node
extern "C" double rod(long n, double l, const double* S, const double* B, const double* mass, double I1, double I3, double* x, double* v, double* R, double* L, double h, long steps, int clamp, const double* load, double damp, double* out) {
    Rod r; r.n = n; r.l = l; r.S = {S[0], S[1], S[2]}; r.B = {B[0], B[1], B[2]}; r.I1 = I1; r.I3 = I3; r.im.resize(n + 1); r.x.resize(n + 1); r.v.resize(n + 1); r.f.resize(n + 1); r.L.resize(n); r.t.resize(n); r.R.resize(n);
    for (long i = 0; i <= n; ++i) { r.im[i] = 1 / mass[i]; r.x[i] = {x[3 * i], x[3 * i + 1], x[3 * i + 2]}; r.v[i] = {v[3 * i], v[3 * i + 1], v[3 * i + 2]}; }
    for (long i = 0; i < n; ++i) { for (int k = 0; k < 9; ++k) r.R[i].a[k] = R[9 * i + k]; r.L[i] = {L[3 * i], L[3 * i + 1], L[3 * i + 2]}; }
    const V pull{load[0], load[1], load[2]}; const double keep = std::exp(-damp * h); const long c = clamp ? 1 : 0;
    auto drift = [&](double h) {
        for (long i = c; i <= n; ++i) r.x[i] = r.x[i] + h * r.v[i];
        const double a = h / I1, b = h * (1 / I3 - 1 / I1);
        for (long i = c; i < n; ++i) {
            V u{r.R[i].a[2], r.R[i].a[5], r.R[i].a[8]}; double s = b * dot(u, r.L[i]), s2 = s * s;
            double sn = s * (1 + s2 * (-1. / 6 + s2 * (1. / 120 - s2 / 5040))), cs = 1 + s2 * (-.5 + s2 * (1. / 24 + s2 * (-1. / 720 + s2 / 40320)));
            M Q = rotation(a * r.L[i]) * r.R[i], P = Q;
            for (int k = 0; k < 3; ++k) { P.a[3 * k] = cs * Q.a[3 * k] + sn * Q.a[3 * k + 1]; P.a[3 * k + 1] = cs * Q.a[3 * k + 1] - sn * Q.a[3 * k]; }
            r.R[i] = P;
        }
    };
    drift(.5 * h);
    for (long s = 0; s < steps; ++s) {
        forces(r, false); r.f[n] = r.f[n] + pull;
        for (long i = c; i <= n; ++i) r.v[i] = keep * (r.v[i] + (h * r.im[i]) * r.f[i]);
        for (long i = c; i < n; ++i) r.L[i] = keep * (r.L[i] + h * r.t[i]);
        drift(s + 1 == steps ? .5 * h : h);
    }
    double E = forces(r, true); V P{0, 0, 0}, J{0, 0, 0};
    for (long i = 0; i <= n; ++i) { E += .5 * mass[i] * dot(r.v[i], r.v[i]); P = P + mass[i] * r.v[i]; J = J + mass[i] * cross(r.x[i], r.v[i]); }
    for (long i = 0; i < n; ++i) { V u{r.R[i].a[2], r.R[i].a[5], r.R[i].a[8]}; double s = dot(u, r.L[i]); E += .5 * (dot(r.L[i], r.L[i]) - s * s) / I1 + .5 * s * s / I3; J = J + r.L[i]; }
    out[0] = P.x; out[1] = P.y; out[2] = P.z; out[3] = J.x; out[4] = J.y; out[5] = J.z;
    for (long i = 0; i <= n; ++i) { x[3 * i] = r.x[i].x; x[3 * i + 1] = r.x[i].y; x[3 * i + 2] = r.x[i].z; v[3 * i] = r.v[i].x; v[3 * i + 1] = r.v[i].y; v[3 * i + 2] = r.v[i].z; }
    for (long i = 0; i < n; ++i) { for (int k = 0; k < 9; ++k) R[9 * i + k] = r.R[i].a[k]; L[3 * i] = r.L[i].x; L[3 * i + 1] = r.L[i].y; L[3 * i + 2] = r.L[i].z; }
    return E;
}
