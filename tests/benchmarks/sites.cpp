// The opponent of runs by sites: RKMK4 for classical spins with exchange, s' = s x (B + J sum of the neighbours), as one
// writes it in C++: components apart, neighbours by a table or, on a ring, by their places, one loop over the spins for
// the field of a stage and one for what follows, both of which the compiler vectorises.
//
// Build: g++ -O3 -march=native -fno-math-errno -shared -fPIC, without contraction and with it.

#include <cmath>
#include <cstddef>
#include <vector>

static inline void coefficients(double q, double &s, double &v) {  // sin(r)/r and (1 - cos r)/r^2, r^2 = q < 1
  s = 1.0 + q * (-1.0 / 6 + q * (1.0 / 120 + q * (-1.0 / 5040 + q * (1.0 / 362880 + q * (-1.0 / 39916800 + q * (1.0 / 6227020800.0))))));
  v = 0.5 + q * (-1.0 / 24 + q * (1.0 / 720 + q * (-1.0 / 40320 + q * (1.0 / 3628800 + q * (-1.0 / 479001600 + q * (1.0 / 87178291200.0))))));
}

struct Planes {
  std::vector<double> of[3];
  explicit Planes(std::size_t n) { for (auto &x : of) x.assign(n, 0.0); }
};

static void field(std::size_t n, int degree, const long *__restrict table, const Planes &at, Planes &out, const double *B) {
  for (int k = 0; k < 3; ++k) {
    const double *__restrict x = at.of[k].data();
    double *__restrict y = out.of[k].data(), b = B[k];
    if (!table) {  // a ring
      y[0] = -b - (x[1 % n] + x[n - 1]);
      y[n - 1] = -b - (x[0] + x[n > 1 ? n - 2 : 0]);
#pragma GCC ivdep
      for (std::size_t i = 1; i + 1 < n; ++i) y[i] = -b - (x[i + 1] + x[i - 1]);
    } else if (degree == 6) {
      const long *__restrict t = table;
#pragma GCC ivdep
      for (std::size_t i = 0; i < n; ++i)
        y[i] = -b - (((x[t[i]] + x[t[n + i]]) + (x[t[2 * n + i]] + x[t[3 * n + i]])) + (x[t[4 * n + i]] + x[t[5 * n + i]]));
    } else {
      for (std::size_t i = 0; i < n; ++i) {
        double sum = b;
        for (int d = 0; d < degree; ++d) sum += x[table[d * n + i]];
        y[i] = -sum;
      }
    }
  }
}

// k = dexp^-1_{-w} xi = xi + w x xi / 2 + w x (w x xi) / 12, with w = a k_before; the next place is exp(-hat(c k)) s
static void stage(std::size_t n, double a, double c, const Planes &before, Planes &k, const Planes &s, Planes &next) {
  const double *__restrict bx = before.of[0].data(), *__restrict by = before.of[1].data(), *__restrict bz = before.of[2].data();
  double *__restrict kx = k.of[0].data(), *__restrict ky = k.of[1].data(), *__restrict kz = k.of[2].data();
  const double *__restrict sx = s.of[0].data(), *__restrict sy = s.of[1].data(), *__restrict sz = s.of[2].data();
  double *__restrict px = next.of[0].data(), *__restrict py = next.of[1].data(), *__restrict pz = next.of[2].data();
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    double x = a * bx[i], y = a * by[i], z = a * bz[i], u = kx[i], v = ky[i], w = kz[i];
    double p = y * w - z * v, q = z * u - x * w, r = x * v - y * u;
    u += 0.5 * p + (1.0 / 12) * (y * r - z * q);
    v += 0.5 * q + (1.0 / 12) * (z * p - x * r);
    w += 0.5 * r + (1.0 / 12) * (x * q - y * p);
    kx[i] = u; ky[i] = v; kz[i] = w;
    x = c * u; y = c * v; z = c * w;
    double S, V;
    coefficients(x * x + y * y + z * z, S, V);
    double l = sx[i], m = sy[i], o = sz[i];
    p = y * o - z * m; q = z * l - x * o; r = x * m - y * l;
    px[i] = l - S * p + V * (y * r - z * q);
    py[i] = m - S * q + V * (z * p - x * r);
    pz[i] = o - S * r + V * (x * q - y * p);
  }
}

extern "C" void rkmk4(std::size_t n, int degree, const long *table, double *io, const double *B, double h, long steps) {
  Planes s(n), at(n), zero(n), k[4] = {Planes(n), Planes(n), Planes(n), Planes(n)}, sum(n), after(n);
  for (int c = 0; c < 3; ++c) for (std::size_t i = 0; i < n; ++i) s.of[c][i] = io[3 * i + c];
  const double c[4] = {0.5 * h, 0.5 * h, h, 0.0}, a[4] = {0.0, 0.5 * h, 0.5 * h, h};
  for (long step = 0; step < steps; ++step) {
    for (int i = 0; i < 4; ++i) {
      field(n, degree, table, i ? at : s, k[i], B);
      stage(n, a[i], c[i], i ? k[i - 1] : zero, k[i], s, at);
    }
    for (int d = 0; d < 3; ++d) {
      double *__restrict y = sum.of[d].data();
      const double *__restrict p = k[0].of[d].data(), *__restrict q = k[1].of[d].data(), *__restrict r = k[2].of[d].data(), *__restrict t = k[3].of[d].data();
#pragma GCC ivdep
      for (std::size_t i = 0; i < n; ++i) y[i] = (p[i] + t[i]) / 6 + (q[i] + r[i]) / 3;
    }
    stage(n, 0.0, h, zero, sum, s, after);
    for (int d = 0; d < 3; ++d) s.of[d].swap(after.of[d]);
  }
  for (int d = 0; d < 3; ++d) for (std::size_t i = 0; i < n; ++i) io[3 * i + d] = s.of[d][i];
}
