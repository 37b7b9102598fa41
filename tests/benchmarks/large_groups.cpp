// The free body of SO(n): isospectral midpoint, fixed points to rounding, products written out in registers, without BLAS.
//   W_0 = (1 + P) W (1 - P),  W_1 = W_0 - 2 [P, W],  P = h I^-1 W/2
#include <algorithm>
#include <cmath>
#include <vector>
typedef double v8 __attribute__((vector_size(64), aligned(8)));
static void product(long n, const double* A, const double* B, double* D) {  // D = A B, four rows by sixteen columns at once
    if (n % 8) {
        for (long i = 0; i < n; ++i)
            for (long j = 0; j < n; ++j) { double s = 0; for (long k = 0; k < n; ++k) s += A[i * n + k] * B[k * n + j]; D[i * n + j] = s; }
        return;
    }
    for (long i = 0; i < n; i += 4) for (long j = 0; j < n; j += 16) {
        v8 s[4][2] = {}; const bool two = j + 16 <= n;
        for (long k = 0; k < n; ++k) {
            v8 p = *(const v8*)(B + k * n + j), q = two ? *(const v8*)(B + k * n + j + 8) : p;
            for (int a = 0; a < 4; ++a) { double x = A[(i + a) * n + k]; s[a][0] += x * p; s[a][1] += x * q; }
        }
        for (int a = 0; a < 4; ++a) { *(v8*)(D + (i + a) * n + j) = s[a][0]; if (two) *(v8*)(D + (i + a) * n + j + 8) = s[a][1]; }
    }
}
// W : (n, n), by rows, moved by so many steps; inverse : (n, n).  Returns the sweeps of a step.
extern "C" double midpoint(long n, double* M, const double* inverse, double h, long steps) {
    const long N = n * n; std::vector<double> W(M, M + N), P(N), A(N), B(N), last(M, M + N), before(M, M + N); long sweeps = 0;
    for (long s = 0; s < steps; ++s) {
        // the middle of the step to come, from the last three momenta
        for (long i = 0; i < N; ++i) {
            double g = s > 1 ? 1.875 * M[i] - 1.25 * last[i] + .375 * before[i] : s ? 1.5 * M[i] - .5 * last[i] : M[i];
            before[i] = last[i]; last[i] = M[i]; W[i] = g;
        }
        double change = 1e300;
        for (int sweep = 0; sweep < 60; ++sweep) {
            ++sweeps;
            for (long i = 0; i < N; ++i) P[i] = .5 * h * inverse[i] * W[i];
            product(n, P.data(), W.data(), A.data()); product(n, A.data(), P.data(), B.data());
            double d = 0, size = 0;  // W P = (P W)^T, as both are antisymmetric
            for (long i = 0; i < n; ++i) for (long j = 0; j < i; ++j) {
                double v = M[i * n + j] - (A[i * n + j] - A[j * n + i]) + .5 * (B[i * n + j] - B[j * n + i]), x = v - W[i * n + j];
                d += x * x; size += v * v; W[i * n + j] = v; W[j * n + i] = -v;
            }
            d = std::sqrt(d); size = std::sqrt(size);
            if (d <= 2.2e-16 * size || (sweep && 16 * d * d / change <= 2.2e-16 * size) || (d < 1e-12 * size && d >= change)) break;
            change = d;
        }
        for (long i = 0; i < n; ++i) for (long j = 0; j < i; ++j) { double v = M[i * n + j] - 2 * (A[i * n + j] - A[j * n + i]); M[i * n + j] = v; M[j * n + i] = -v; }
    }
    return double(sweeps) / steps;
}
