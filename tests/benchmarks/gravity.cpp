// Point masses by direct sums: kicks and drifts in turn, of any splitting, with exact square roots and divisions.  Of few
// bodies eight side by side feel all others one after the other (`pull`); of more, eight meet eight others in a ring that
// turns, each pair once (`once`).
#include <cmath>
#include <type_traits>
#include <vector>
typedef double Eight __attribute__((vector_size(64), aligned(8)));
typedef long Mask __attribute__((vector_size(64)));
static inline Eight load(const double* p) { return *reinterpret_cast<const Eight*>(p); }
static inline void store(double* p, Eight v) { *reinterpret_cast<Eight*>(p) = v; }
static inline Eight root(Eight v) { for (int k = 0; k < 8; ++k) v[k] = std::sqrt(v[k]); return v; }
struct Bodies { long n, pad; std::vector<double> x[3], v[3], a[3], m; };
static void pull(Bodies& B) {
    const double *X = B.x[0].data(), *Y = B.x[1].data(), *Z = B.x[2].data(), *M = B.m.data();
    auto block = [&](auto K, long i) {
        constexpr int k = decltype(K)::value;
        Eight x[k], y[k], z[k], ax[k], ay[k], az[k];
        for (int b = 0; b < k; ++b) {
            x[b] = load(X + i + 8 * b); y[b] = load(Y + i + 8 * b); z[b] = load(Z + i + 8 * b);
            ax[b] = ay[b] = az[b] = Eight{};
        }
        for (long j = 0; j < B.n; ++j) for (int b = 0; b < k; ++b) {
            Eight dx = X[j] - x[b], dy = Y[j] - y[b], dz = Z[j] - z[b];
            Eight s = dx * dx + dy * dy + dz * dz;
            Mask apart = s != 0.0;
            Eight w = M[j] / (s * root(s));
            w = reinterpret_cast<Eight>(reinterpret_cast<Mask>(w) & apart);
            ax[b] += w * dx; ay[b] += w * dy; az[b] += w * dz;
        }
        for (int b = 0; b < k; ++b) {
            store(&B.a[0][i + 8 * b], ax[b]); store(&B.a[1][i + 8 * b], ay[b]); store(&B.a[2][i + 8 * b], az[b]);
        }
    };
    long i = 0;
    for (; i + 32 <= B.pad; i += 32) block(std::integral_constant<int, 4>(), i);
    for (; i + 16 <= B.pad; i += 16) block(std::integral_constant<int, 2>(), i);
    for (; i < B.pad; i += 8) block(std::integral_constant<int, 1>(), i);
}
static inline Eight turned(Eight v) { return __builtin_shuffle(v, Mask{1, 2, 3, 4, 5, 6, 7, 0}); }
static void once(Bodies& B) {
    for (int k = 0; k < 3; ++k) B.a[k].assign(B.pad, 0.0);
    for (long i = 0; i < B.pad; i += 8) {
        Eight x[3], a[3], m = load(&B.m[i]), y[3], b[3], n = m;
        for (int k = 0; k < 3; ++k) { x[k] = y[k] = load(&B.x[k][i]); a[k] = load(&B.a[k][i]); }
        for (int r = 1; r < 8; ++r) {
            Eight d[3], s = Eight{};
            n = turned(n);
            for (int k = 0; k < 3; ++k) { y[k] = turned(y[k]); d[k] = y[k] - x[k]; s += d[k] * d[k]; }
            Eight w = n / (s * root(s));
            for (int k = 0; k < 3; ++k) a[k] += w * d[k];
        }
        for (long j = i + 8; j < B.pad; j += 8) {
            n = load(&B.m[j]);
            for (int k = 0; k < 3; ++k) { y[k] = load(&B.x[k][j]); b[k] = load(&B.a[k][j]); }
            for (int r = 0; r < 8; ++r) {
                Eight d[3], s = Eight{};
                for (int k = 0; k < 3; ++k) { d[k] = y[k] - x[k]; s += d[k] * d[k]; }
                Eight w = 1.0 / (s * root(s)), u = n * w, v = m * w;
                for (int k = 0; k < 3; ++k) { a[k] += u * d[k]; b[k] = turned(b[k] - v * d[k]); y[k] = turned(y[k]); }
                n = turned(n);
            }
            for (int k = 0; k < 3; ++k) store(&B.a[k][j], b[k]);
        }
        for (int k = 0; k < 3; ++k) store(&B.a[k][i], a[k]);
    }
}
static void add(std::vector<double>* x, const std::vector<double>* y, double h) {
    for (int k = 0; k < 3; ++k) for (size_t i = 0; i < x[k].size(); ++i) x[k][i] += h * y[k][i];
}
// q, v: (n, 3).  kicks: (drifts + 1); the last force of a step is the first of the next one
extern "C" void gravity(long n, const double* m, double* q, double* v, double h, long steps, long drifts,
                        const double* kick, const double* drift) {
    Bodies B; B.n = n; B.pad = (n + 7) / 8 * 8;
    for (int k = 0; k < 3; ++k) { B.x[k].resize(B.pad); B.v[k].assign(B.pad, 0); B.a[k].assign(B.pad, 0); }
    B.m.assign(B.pad, 0);
    for (int k = 0; k < 3; ++k) for (long i = n; i < B.pad; ++i) B.x[k][i] = 1e30 * (k + 1 + i);  // far from all and each other
    auto forces = [&] { if (n > 16) once(B); else pull(B); };
    for (long i = 0; i < n; ++i) {
        B.m[i] = m[i];
        for (int k = 0; k < 3; ++k) { B.x[k][i] = q[3 * i + k]; B.v[k][i] = v[3 * i + k]; }
    }
    const bool first = kick[0] != 0.0;
    if (first) forces();
    for (long t = 0; t < steps; ++t) for (long i = 0; i <= drifts; ++i) {
        if (kick[i] != 0.0) { if (i > 0) forces(); add(B.v, B.a, kick[i] * h); }
        if (i < drifts) add(B.x, B.v, drift[i] * h);
    }
    for (long i = 0; i < n; ++i) for (int k = 0; k < 3; ++k) { q[3 * i + k] = B.x[k][i]; v[3 * i + k] = B.v[k][i]; }
}
