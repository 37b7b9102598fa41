// The opponent of chains: N equal rods on ball joints, mass 1, length 1, radius 0.05, hanging from the origin, by RATTLE on SE(3)^N: the exact flow of a free symmetric top between kicks,
// multipliers by a quasi-Newton iteration with the block tridiagonal S = G M^-1 G^T, factored once a step, which serves the hidden constraint too.
//
// `chain_rattle` goes rod by rod, `chain_lanes` has everything but the recursions of the blocks in SIMD lanes across the rods.  Multipliers are extrapolated from three steps.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract=off -shared -fPIC

#include <algorithm>
#include <cmath>
#include <vector>

// ------------------------------------------------------------------ small vectors and matrices, rotations by polynomials

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
static inline M operator+(const M& a, const M& b) { M c; for (int i = 0; i < 9; ++i) c.a[i] = a.a[i] + b.a[i]; return c; }
static inline M operator-(const M& a, const M& b) { M c; for (int i = 0; i < 9; ++i) c.a[i] = a.a[i] - b.a[i]; return c; }
static inline M T(const M& a) { return {{a.a[0], a.a[3], a.a[6], a.a[1], a.a[4], a.a[7], a.a[2], a.a[5], a.a[8]}}; }
static inline M hat(V v) { return {{0, -v.z, v.y, v.z, 0, -v.x, -v.y, v.x, 0}}; }
static inline M diag(double s) { return {{s, 0, 0, 0, s, 0, 0, 0, s}}; }
static inline M inverse_spd(const M& m) {                          // of a symmetric matrix
    double a = m.a[0], b = m.a[1], c = m.a[2], d = m.a[4], e = m.a[5], f = m.a[8];
    double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d, q = 1.0 / (a * A + b * B + c * C);
    return {{q * A, q * B, q * C, q * B, q * (a * f - c * c), q * (b * c - a * e), q * C, q * (b * c - a * e), q * (a * d - b * b)}};
}
// sin(t)/t and (1 - cos t)/t^2 of t^2 = x, to rounding for t below 1.3
static inline void rodrigues(double x, double& s, double& c) {
    s = 1 + x * (-1. / 6 + x * (1. / 120 + x * (-1. / 5040 + x * (1. / 362880 + x * (-1. / 39916800 + x * (1. / 6227020800. + x * (-1. / 1307674368000. + x * (1. / 355687428096000.))))))));
    c = .5 + x * (-1. / 24 + x * (1. / 720 + x * (-1. / 40320 + x * (1. / 3628800 + x * (-1. / 479001600. + x * (1. / 87178291200. + x * (-1. / 20922789888000. + x * (1. / 6402373705728000.))))))));
}
static inline V rotate(V w, V v) {                                 // exp(hat(w)) v
    double s, c; rodrigues(dot(w, w), s, c);
    V a = cross(w, v); return v + s * a + c * cross(w, a);
}
static inline M rotation(V w) {
    double s, c; rodrigues(dot(w, w), s, c);
    double xx = c * w.x * w.x, yy = c * w.y * w.y, zz = c * w.z * w.z, xy = c * w.x * w.y, xz = c * w.x * w.z, yz = c * w.y * w.z;
    return {{1 - yy - zz, xy - s * w.z, xz + s * w.y, xy + s * w.z, 1 - xx - zz, yz - s * w.x, xz - s * w.y, yz + s * w.x, 1 - xx - yy}};
}

// ------------------------------------------------------------------ rod by rod

static const double m_ = 1, len = 1, rad = .05, g0 = 9.80665;
static const double I1 = m_ * (3 * rad * rad + len * len) / 12, I3 = .5 * m_ * rad * rad;

struct Chain {                 // p: centres, R: attitudes, v: velocities, l: angular momenta in space axes, lam: multipliers
    long n; std::vector<V> p, v, l, lam, lam1, lam2, r, d; std::vector<M> R, Di, E; V at{0, 0, .5 * len}, ab{0, 0, -.5 * len};
    std::vector<V> p1, v1, l1; std::vector<M> R1, Rm; long iterations = 0, refactored = 0;
    explicit Chain(long n) : n(n), p(n), v(n), l(n), lam(n, V{0, 0, 0}), lam1(n, V{0, 0, 0}), lam2(n, V{0, 0, 0}), r(n), d(n), R(n), Di(n), E(n), p1(n), v1(n), l1(n), R1(n), Rm(n) { }
};
// S = G M^-1 G^T at attitudes R, and its block LDL^T.  c_j = p_j + R_j at - p_(j-1) - R_(j-1) ab
static void factor(Chain& c, const std::vector<M>& R) {
    M carry = diag(0);                                             // what body j - 1 adds to the diagonal block of c_j
    for (long j = 0; j < c.n; ++j) {
        V u{R[j].a[2], R[j].a[5], R[j].a[8]};
        auto W = [&](V a, V b) {                                   // hat(a) I^-1 hat(b)^T, I^-1 = 1/I1 + (1/I3 - 1/I1) u u^T
            double s = dot(a, b) / I1; M w; double A[3] = {a.x, a.y, a.z}, B[3] = {b.x, b.y, b.z};
            for (int i = 0; i < 3; ++i) for (int k = 0; k < 3; ++k) w.a[3 * i + k] = (i == k ? s : 0) - B[i] * A[k] / I1;
            V x = cross(a, u), y = cross(b, u); double X[3] = {x.x, x.y, x.z}, Y[3] = {y.x, y.y, y.z}, q = 1 / I3 - 1 / I1;
            for (int i = 0; i < 3; ++i) for (int k = 0; k < 3; ++k) w.a[3 * i + k] += q * X[i] * Y[k];
            return w; };
        V a = R[j] * c.at, b = R[j] * c.ab;
        M D = diag(1 / m_) + W(a, a) + carry;
        if (j) { M& Lo = c.E[j]; M X = Lo * c.Di[j - 1]; D = D - X * T(Lo); Lo = X; }      // E becomes the factor L_j = S_(j,j-1) D_(j-1)^-1
        c.Di[j] = inverse_spd(D);
        carry = diag(1 / m_) + W(b, b);
        if (j + 1 < c.n) c.E[j + 1] = diag(0) - diag(1 / m_) - W(b, a);
    }
}
static void solve(Chain& c, std::vector<V>& x) {                   // in place
    for (long j = 1; j < c.n; ++j) x[j] = x[j] - c.E[j] * x[j - 1];
    for (long j = 0; j < c.n; ++j) x[j] = c.Di[j] * x[j];
    for (long j = c.n - 2; j >= 0; --j) x[j] = x[j] - tmul(c.E[j + 1], x[j + 1]);
}
// the kick by gravity and by -G^T lam, both times s, from (v, l) to (v1, l1)
static inline void kick(const Chain& c, const std::vector<M>& R, const std::vector<V>& lam, double s, long j, V& v, V& l) {
    V f = lam[j], t = cross(R[j] * c.at, lam[j]);
    if (j + 1 < c.n) { f = f - lam[j + 1]; t = t - cross(R[j] * c.ab, lam[j + 1]); }
    v = v - (s / m_) * f - V{0, 0, s * g0}; l = l - s * t;
}
static inline void drift(double h, V& p, M& R, V v, V l) {
    p = p + h * v;
    V u{R.a[2], R.a[5], R.a[8]};
    double spin = h * (1 / I3 - 1 / I1) * dot(u, l);
    R = rotation((h / I1) * l) * R * rotation(V{0, 0, spin});
}
static double rattle(Chain& c, double h, long steps, double tol) {
    double worst = 0;
    factor(c, c.R);
    for (long k = 0; k < steps; ++k) {
        for (long j = 0; j < c.n; ++j) { V e = 3 * (c.lam[j] - c.lam1[j]) + c.lam2[j]; c.lam2[j] = c.lam1[j]; c.lam1[j] = c.lam[j]; c.lam[j] = e; }
        double last = 1e300; bool again = false;
        for (int it = 0;; ++it) {
            for (long j = 0; j < c.n; ++j) {
                V v = c.v[j], l = c.l[j]; kick(c, c.R, c.lam, .5 * h, j, v, l);
                V p = c.p[j]; M R = c.R[j]; drift(h, p, R, v, l);
                c.p1[j] = p; c.R1[j] = R; c.v1[j] = v; c.l1[j] = l;
            }
            double miss = 0, far = 1;
            for (long j = 0; j < c.n; ++j) {
                V q = c.p1[j] + c.R1[j] * c.at; if (j) q = q - c.p1[j - 1] - c.R1[j - 1] * c.ab;
                c.r[j] = q; miss = std::max(miss, std::max(std::fabs(q.x), std::max(std::fabs(q.y), std::fabs(q.z))));
                far = std::max(far, std::fabs(c.p1[j].z) + std::fabs(c.p1[j].x) + std::fabs(c.p1[j].y));
            }
            ++c.iterations;
            if (miss <= tol * far || it == 40 || (miss >= .5 * last && miss < 1e-14 * far)) { if (k) worst = std::max(worst, miss / far); break; }
            if (it > 0 && miss > .15 * last && miss > 1e-13 * far && !again) {             // slow: the matrix half way, as the step's own derivative almost is
                for (long j = 0; j < c.n; ++j) for (int i = 0; i < 9; ++i) c.Rm[j].a[i] = .5 * (c.R[j].a[i] + c.R1[j].a[i]);
                factor(c, c.Rm); again = true; ++c.refactored;
            }
            last = miss;
            solve(c, c.r);
            for (long j = 0; j < c.n; ++j) c.lam[j] = c.lam[j] + (2 / (h * h)) * c.r[j];
        }
        std::swap(c.p, c.p1); std::swap(c.R, c.R1); std::swap(c.v, c.v1); std::swap(c.l, c.l1);
        factor(c, c.R);
        // second kick: gravity, then onto G M^-1 p = 0
        for (long j = 0; j < c.n; ++j) c.v[j].z -= .5 * h * g0;
        V before{0, 0, 0};
        for (long j = 0; j < c.n; ++j) {
            V u{c.R[j].a[2], c.R[j].a[5], c.R[j].a[8]}, l = c.l[j], w = (1 / I1) * l + ((1 / I3 - 1 / I1) * dot(u, l)) * u;
            c.r[j] = c.v[j] + cross(w, c.R[j] * c.at) - before; before = c.v[j] + cross(w, c.R[j] * c.ab);
        }
        solve(c, c.r);
        for (long j = 0; j < c.n; ++j) {
            V f = c.r[j], t = cross(c.R[j] * c.at, c.r[j]);
            if (j + 1 < c.n) { f = f - c.r[j + 1]; t = t - cross(c.R[j] * c.ab, c.r[j + 1]); }
            c.v[j] = c.v[j] - (1 / m_) * f; c.l[j] = c.l[j] - t;
        }
        if (k == 0) { c.lam1 = c.lam; c.lam2 = c.lam; }
        else if (k == 1) for (long j = 0; j < c.n; ++j) c.lam2[j] = 2 * c.lam1[j] - c.lam[j];
    }
    return worst;
}
static double energy(const Chain& c) {
    double H = 0;
    for (long j = 0; j < c.n; ++j) {
        V u{c.R[j].a[2], c.R[j].a[5], c.R[j].a[8]}; double s = dot(u, c.l[j]);
        H += .5 * m_ * dot(c.v[j], c.v[j]) + .5 * (dot(c.l[j], c.l[j]) - s * s) / I1 + .5 * s * s / I3 + m_ * g0 * c.p[j].z;
    }
    return H;
}
// R0: N attitudes, at rest.  out: energy at `samples` times.  Returns the worst miss; iterations a step in its[0].
extern "C" double chain_rattle(long n, const double* R0, double h, long steps, long samples, double tol, double* H, double* its, double* Rend) {
    Chain c(n); V end{0, 0, 0};
    for (long j = 0; j < n; ++j) {
        for (int i = 0; i < 9; ++i) c.R[j].a[i] = R0[9 * j + i];
        c.p[j] = end - c.R[j] * c.at; end = c.p[j] + c.R[j] * c.ab; c.v[j] = c.l[j] = V{0, 0, 0};
    }
    double worst = 0;
    for (long s = 0; s < samples; ++s) { H[s] = energy(c); worst = std::max(worst, rattle(c, h, steps / samples, tol)); }
    its[0] = double(c.iterations) / steps;
    if (Rend) for (long j = 0; j < n; ++j) for (int i = 0; i < 9; ++i) Rend[9 * j + i] = c.R[j].a[i];
    return worst;
}


// ------------------------------------------------------------------ in lanes across the rods

typedef std::vector<double> A;
struct Lanes {
    long n; A p[3], v[3], l[3], R[9], p1[3], v1[3], l1[3], R1[9], L[3], La[3], Lb[3], B[3], r[3], D[6], O[9]; std::vector<M> Di, E; long its = 0;
    explicit Lanes(long n) : n(n), Di(n), E(n) { for (auto* f : {p, v, l, p1, v1, l1, L, La, Lb, B, r}) for (int k = 0; k < 3; ++k) f[k].assign(n + 9, 0); for (auto* f : {R, R1, O}) for (int k = 0; k < 9; ++k) f[k].assign(n + 9, 0); for (auto& f : D) f.assign(n + 9, 0); }
};
static const double at[3] = {0, 0, .5 * len}, ab[3] = {0, 0, -.5 * len};
#define COPY3(x) double *x##0 = c.x[0].data(), *x##1 = c.x[1].data(), *x##2 = c.x[2].data()
#define COPY9(x, y) double *y##0 = c.x[0].data(), *y##1 = c.x[1].data(), *y##2 = c.x[2].data(), *y##3 = c.x[3].data(), *y##4 = c.x[4].data(), *y##5 = c.x[5].data(), *y##6 = c.x[6].data(), *y##7 = c.x[7].data(), *y##8 = c.x[8].data()
// a try: kick by half a step of gravity and multipliers, drift, ends of the rods; returns the largest miss
static double attempt(Lanes& c, double h) {
    COPY3(p); COPY3(v); COPY3(l); COPY3(L); COPY3(B); COPY3(r); COPY9(R, a); COPY9(R1, b);
    double *P0 = c.p1[0].data(), *P1 = c.p1[1].data(), *P2 = c.p1[2].data(), *V0 = c.v1[0].data(), *V1 = c.v1[1].data(), *V2 = c.v1[2].data(), *W0 = c.l1[0].data(), *W1 = c.l1[1].data(), *W2 = c.l1[2].data();
    const double s = .5 * h, k1 = h / I1, k3 = h * (1 / I3 - 1 / I1);
#pragma GCC ivdep
    for (long j = 0; j < c.n; ++j) {
        double x0 = a0[j] * at[0] + a1[j] * at[1] + a2[j] * at[2], x1 = a3[j] * at[0] + a4[j] * at[1] + a5[j] * at[2], x2 = a6[j] * at[0] + a7[j] * at[1] + a8[j] * at[2];
        double y0 = a0[j] * ab[0] + a1[j] * ab[1] + a2[j] * ab[2], y1 = a3[j] * ab[0] + a4[j] * ab[1] + a5[j] * ab[2], y2 = a6[j] * ab[0] + a7[j] * ab[1] + a8[j] * ab[2];
        double u0 = L0[j], u1 = L1[j], u2 = L2[j], w0 = L0[j + 1], w1 = L1[j + 1], w2 = L2[j + 1];
        double vx = v0[j] - s / m_ * (u0 - w0), vy = v1[j] - s / m_ * (u1 - w1), vz = v2[j] - s / m_ * (u2 - w2) - s * g0;
        double lx = l0[j] - s * (x1 * u2 - x2 * u1 - y1 * w2 + y2 * w1), ly = l1[j] - s * (x2 * u0 - x0 * u2 - y2 * w0 + y0 * w2), lz = l2[j] - s * (x0 * u1 - x1 * u0 - y0 * w1 + y1 * w0);
        V0[j] = vx; V1[j] = vy; V2[j] = vz; W0[j] = lx; W1[j] = ly; W2[j] = lz;
        double spin = k3 * (a2[j] * lx + a5[j] * ly + a8[j] * lz), S, D; rodrigues(spin * spin, S, D); double sn = S * spin, cs = 1 - D * spin * spin;
        double c0 = cs * a0[j] + sn * a1[j], d0 = cs * a1[j] - sn * a0[j], c1 = cs * a3[j] + sn * a4[j], d1 = cs * a4[j] - sn * a3[j], c2 = cs * a6[j] + sn * a7[j], d2 = cs * a7[j] - sn * a6[j];
        double e0 = k1 * lx, e1 = k1 * ly, e2 = k1 * lz; rodrigues(e0 * e0 + e1 * e1 + e2 * e2, S, D);
        double q00 = 1 - D * (e1 * e1 + e2 * e2), q11 = 1 - D * (e0 * e0 + e2 * e2), q22 = 1 - D * (e0 * e0 + e1 * e1), q01 = D * e0 * e1 - S * e2, q10 = D * e0 * e1 + S * e2, q02 = D * e0 * e2 + S * e1, q20 = D * e0 * e2 - S * e1, q12 = D * e1 * e2 - S * e0, q21 = D * e1 * e2 + S * e0;
        double g0_ = q00 * c0 + q01 * c1 + q02 * c2, g3 = q10 * c0 + q11 * c1 + q12 * c2, g6 = q20 * c0 + q21 * c1 + q22 * c2;
        double g1 = q00 * d0 + q01 * d1 + q02 * d2, g4 = q10 * d0 + q11 * d1 + q12 * d2, g7 = q20 * d0 + q21 * d1 + q22 * d2;
        double g2 = q00 * a2[j] + q01 * a5[j] + q02 * a8[j], g5 = q10 * a2[j] + q11 * a5[j] + q12 * a8[j], g8 = q20 * a2[j] + q21 * a5[j] + q22 * a8[j];
        b0[j] = g0_; b1[j] = g1; b2[j] = g2; b3[j] = g3; b4[j] = g4; b5[j] = g5; b6[j] = g6; b7[j] = g7; b8[j] = g8;
        double px = p0[j] + h * vx, py = p1[j] + h * vy, pz = p2[j] + h * vz; P0[j] = px; P1[j] = py; P2[j] = pz;
        r0[j] = px + g0_ * at[0] + g1 * at[1] + g2 * at[2]; r1[j] = py + g3 * at[0] + g4 * at[1] + g5 * at[2]; r2[j] = pz + g6 * at[0] + g7 * at[1] + g8 * at[2];
        B0[j + 1] = px + g0_ * ab[0] + g1 * ab[1] + g2 * ab[2]; B1[j + 1] = py + g3 * ab[0] + g4 * ab[1] + g5 * ab[2]; B2[j + 1] = pz + g6 * ab[0] + g7 * ab[1] + g8 * ab[2];
    }
    double miss = 0;
#pragma omp simd reduction(max : miss)
    for (long j = 0; j < c.n; ++j) {
        r0[j] -= B0[j]; r1[j] -= B1[j]; r2[j] -= B2[j];
        double e = std::fmax(std::fabs(r0[j]), std::fmax(std::fabs(r1[j]), std::fabs(r2[j]))); miss = std::fmax(miss, e);
    }
    return miss;
}
static void factor(Lanes& c) {                                     // S at R: its blocks in lanes, then the recursion
    COPY9(R, a); COPY9(O, o); double *D0 = c.D[0].data(), *D1 = c.D[1].data(), *D2 = c.D[2].data(), *D3 = c.D[3].data(), *D4 = c.D[4].data(), *D5 = c.D[5].data();
    const double i1 = 1 / I1, q = 1 / I3 - 1 / I1;
    static thread_local A C[6]; for (auto& f : C) if ((long)f.size() < c.n + 9) f.assign(c.n + 9, 0);
    double *C0 = C[0].data() + 1, *C1 = C[1].data() + 1, *C2 = C[2].data() + 1, *C3 = C[3].data() + 1, *C4 = C[4].data() + 1, *C5 = C[5].data() + 1;
#pragma GCC ivdep
    for (long j = 0; j < c.n; ++j) {
        double x0 = a0[j] * at[0] + a1[j] * at[1] + a2[j] * at[2], x1 = a3[j] * at[0] + a4[j] * at[1] + a5[j] * at[2], x2 = a6[j] * at[0] + a7[j] * at[1] + a8[j] * at[2];
        double y0 = a0[j] * ab[0] + a1[j] * ab[1] + a2[j] * ab[2], y1 = a3[j] * ab[0] + a4[j] * ab[1] + a5[j] * ab[2], y2 = a6[j] * ab[0] + a7[j] * ab[1] + a8[j] * ab[2];
        double u0 = a2[j], u1 = a5[j], u2 = a8[j], X0 = x1 * u2 - x2 * u1, X1 = x2 * u0 - x0 * u2, X2 = x0 * u1 - x1 * u0, Y0 = y1 * u2 - y2 * u1, Y1 = y2 * u0 - y0 * u2, Y2 = y0 * u1 - y1 * u0;
        double xx = i1 * (x0 * x0 + x1 * x1 + x2 * x2) + 1 / m_, yy = i1 * (y0 * y0 + y1 * y1 + y2 * y2) + 1 / m_, xy = i1 * (x0 * y0 + x1 * y1 + x2 * y2) + 1 / m_;
        D0[j] = xx - i1 * x0 * x0 + q * X0 * X0; D1[j] = q * X0 * X1 - i1 * x0 * x1; D2[j] = q * X0 * X2 - i1 * x0 * x2; D3[j] = xx - i1 * x1 * x1 + q * X1 * X1; D4[j] = q * X1 * X2 - i1 * x1 * x2; D5[j] = xx - i1 * x2 * x2 + q * X2 * X2;
        C0[j] = yy - i1 * y0 * y0 + q * Y0 * Y0; C1[j] = q * Y0 * Y1 - i1 * y0 * y1; C2[j] = q * Y0 * Y2 - i1 * y0 * y2; C3[j] = yy - i1 * y1 * y1 + q * Y1 * Y1; C4[j] = q * Y1 * Y2 - i1 * y1 * y2; C5[j] = yy - i1 * y2 * y2 + q * Y2 * Y2;
        // S_(j+1, j) = -1/m - W(b, a), W_ik = delta (a.b)/I1 - a_i b_k / I1 ... with W(b, a)_ik = (a.b) delta/I1 - a_i b_k/I1 + q Y_i X_k
        o0[j] = -(xy - i1 * x0 * y0 + q * Y0 * X0); o1[j] = -(-i1 * x0 * y1 + q * Y0 * X1); o2[j] = -(-i1 * x0 * y2 + q * Y0 * X2);
        o3[j] = -(-i1 * x1 * y0 + q * Y1 * X0); o4[j] = -(xy - i1 * x1 * y1 + q * Y1 * X1); o5[j] = -(-i1 * x1 * y2 + q * Y1 * X2);
        o6[j] = -(-i1 * x2 * y0 + q * Y2 * X0); o7[j] = -(-i1 * x2 * y1 + q * Y2 * X1); o8[j] = -(xy - i1 * x2 * y2 + q * Y2 * X2);
    }
    C0[-1] = C1[-1] = C2[-1] = C3[-1] = C4[-1] = C5[-1] = 0;       // the ground does not give way
    for (long j = 0; j < c.n; ++j) {
        double d0 = D0[j] + C0[j - 1], d1 = D1[j] + C1[j - 1], d2 = D2[j] + C2[j - 1], d3 = D3[j] + C3[j - 1], d4 = D4[j] + C4[j - 1], d5 = D5[j] + C5[j - 1];
        if (j) {
            M S{{o0[j - 1], o1[j - 1], o2[j - 1], o3[j - 1], o4[j - 1], o5[j - 1], o6[j - 1], o7[j - 1], o8[j - 1]}}; M X = S * c.Di[j - 1]; const double *x = X.a, *y = S.a;
            d0 -= x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; d1 -= x[0] * y[3] + x[1] * y[4] + x[2] * y[5]; d2 -= x[0] * y[6] + x[1] * y[7] + x[2] * y[8];
            d3 -= x[3] * y[3] + x[4] * y[4] + x[5] * y[5]; d4 -= x[3] * y[6] + x[4] * y[7] + x[5] * y[8]; d5 -= x[6] * y[6] + x[7] * y[7] + x[8] * y[8]; c.E[j] = X;
        }
        c.Di[j] = inverse_spd({{d0, d1, d2, d1, d3, d4, d2, d4, d5}});
    }
}
static void solve(Lanes& c) {
    COPY3(r); V x{r0[0], r1[0], r2[0]};
    for (long j = 1; j < c.n; ++j) { x = V{r0[j], r1[j], r2[j]} - c.E[j] * x; r0[j] = x.x; r1[j] = x.y; r2[j] = x.z; }
    for (long j = c.n - 1; j >= 0; --j) { V y = c.Di[j] * V{r0[j], r1[j], r2[j]}; if (j + 1 < c.n) y = y - tmul(c.E[j + 1], x); x = y; r0[j] = x.x; r1[j] = x.y; r2[j] = x.z; }
}
extern "C" double chain_lanes(long n, const double* R0, double h, long steps, double tol, double* its, double* Rend) {
    Lanes c(n); V end{0, 0, 0}; double worst = 0;
    for (long j = 0; j < n; ++j) { for (int i = 0; i < 9; ++i) c.R[i][j] = R0[9 * j + i]; V u{R0[9 * j + 2], R0[9 * j + 5], R0[9 * j + 8]}, q = end - (.5 * len) * u; c.p[0][j] = q.x; c.p[1][j] = q.y; c.p[2][j] = q.z; end = end - len * u; }
    factor(c);
    for (long k = 0; k < steps; ++k) {
        for (int i = 0; i < 3; ++i) { double *x = c.L[i].data(), *y = c.La[i].data(), *z = c.Lb[i].data();
#pragma GCC ivdep
            for (long j = 0; j < n; ++j) { double e = 3 * (x[j] - y[j]) + z[j]; z[j] = y[j]; y[j] = x[j]; x[j] = e; } }
        double last = 1e300, far = 1;
        for (int it = 0;; ++it) {
            double miss = attempt(c, h); ++c.its; far = std::max(1.0, std::fabs(c.p1[0][n - 1]) + std::fabs(c.p1[1][n - 1]) + std::fabs(c.p1[2][n - 1]));
            if (miss <= tol * far || it == 40 || (miss >= .5 * last && miss < 1e-14 * far)) { if (k) worst = std::max(worst, miss / far); break; }
            last = miss; solve(c);
            for (int i = 0; i < 3; ++i) { double *x = c.L[i].data(), *y = c.r[i].data(); const double q = 2 / (h * h);
#pragma GCC ivdep
                for (long j = 0; j < n; ++j) x[j] += q * y[j]; }
        }
        for (int i = 0; i < 3; ++i) { c.p[i].swap(c.p1[i]); c.v[i].swap(c.v1[i]); c.l[i].swap(c.l1[i]); } for (int i = 0; i < 9; ++i) c.R[i].swap(c.R1[i]);
        factor(c);
        {   COPY3(v); COPY3(l); COPY3(r); COPY3(B); COPY9(R, a);
#pragma GCC ivdep
            for (long j = 0; j < n; ++j) {
                double z = v2[j] - .5 * h * g0; v2[j] = z; double s = (1 / I3 - 1 / I1) * (a2[j] * l0[j] + a5[j] * l1[j] + a8[j] * l2[j]), w0 = l0[j] / I1 + s * a2[j], w1 = l1[j] / I1 + s * a5[j], w2 = l2[j] / I1 + s * a8[j];
                double x0 = a0[j] * at[0] + a1[j] * at[1] + a2[j] * at[2], x1 = a3[j] * at[0] + a4[j] * at[1] + a5[j] * at[2], x2 = a6[j] * at[0] + a7[j] * at[1] + a8[j] * at[2];
                double y0 = a0[j] * ab[0] + a1[j] * ab[1] + a2[j] * ab[2], y1 = a3[j] * ab[0] + a4[j] * ab[1] + a5[j] * ab[2], y2 = a6[j] * ab[0] + a7[j] * ab[1] + a8[j] * ab[2];
                r0[j] = v0[j] + w1 * x2 - w2 * x1; r1[j] = v1[j] + w2 * x0 - w0 * x2; r2[j] = z + w0 * x1 - w1 * x0; B0[j + 1] = v0[j] + w1 * y2 - w2 * y1; B1[j + 1] = v1[j] + w2 * y0 - w0 * y2; B2[j + 1] = z + w0 * y1 - w1 * y0;
            }
            for (long j = 1; j < n; ++j) { r0[j] -= B0[j]; r1[j] -= B1[j]; r2[j] -= B2[j]; }
            solve(c); r0[n] = r1[n] = r2[n] = 0;
#pragma GCC ivdep
            for (long j = 0; j < n; ++j) {
                double x0 = a0[j] * at[0] + a1[j] * at[1] + a2[j] * at[2], x1 = a3[j] * at[0] + a4[j] * at[1] + a5[j] * at[2], x2 = a6[j] * at[0] + a7[j] * at[1] + a8[j] * at[2];
                double y0 = a0[j] * ab[0] + a1[j] * ab[1] + a2[j] * ab[2], y1 = a3[j] * ab[0] + a4[j] * ab[1] + a5[j] * ab[2], y2 = a6[j] * ab[0] + a7[j] * ab[1] + a8[j] * ab[2];
                double u0 = r0[j], u1 = r1[j], u2 = r2[j], w0 = r0[j + 1], w1 = r1[j + 1], w2 = r2[j + 1];
                v0[j] -= (u0 - w0) / m_; v1[j] -= (u1 - w1) / m_; v2[j] -= (u2 - w2) / m_;
                l0[j] -= x1 * u2 - x2 * u1 - y1 * w2 + y2 * w1; l1[j] -= x2 * u0 - x0 * u2 - y2 * w0 + y0 * w2; l2[j] -= x0 * u1 - x1 * u0 - y0 * w1 + y1 * w0;
            } }
        if (k == 0) for (int i = 0; i < 3; ++i) c.La[i] = c.L[i], c.Lb[i] = c.L[i];
        else if (k == 1) for (int i = 0; i < 3; ++i) for (long j = 0; j < n; ++j) c.Lb[i][j] = 2 * c.La[i][j] - c.L[i][j];
    }
    its[0] = double(c.its) / steps; for (long j = 0; j < n; ++j) for (int i = 0; i < 9; ++i) Rend[9 * j + i] = c.R[i][j];
    return worst;
}
