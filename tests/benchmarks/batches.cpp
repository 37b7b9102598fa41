// The opponent of batches: plain loops over rows, as one writes them in C++ when no library is at hand.
//
// Rotation matrices are rows of 9 numbers, vectors rows of 3; motions are rows of 16, screws (angular part first) rows of 6.  Every loop is good to rounding for every rotation, half turns included; more than that
// (the last digits beside whole turns, arguments that are checked) is not asked of it.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract=off -shared -fPIC

#include <cmath>
#include <cstddef>

#define ROWS extern "C" void

ROWS so3_exp(const double *__restrict w, double *__restrict g, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, w += 3, g += 9) {
    double x = w[0], y = w[1], z = w[2], square = x * x + y * y + z * z, a = 1.0, b = 0.5;
    if (square > 1e-16) {
      double angle = std::sqrt(square), half = std::sin(0.5 * angle);
      a = std::sin(angle) / angle;
      b = 2.0 * half * half / square;
    }
    double xy = b * x * y, xz = b * x * z, yz = b * y * z;
    g[0] = 1.0 - b * (y * y + z * z); g[1] = xy - a * z;                g[2] = xz + a * y;
    g[3] = xy + a * z;                g[4] = 1.0 - b * (x * x + z * z); g[5] = yz - a * x;
    g[6] = xz - a * y;                g[7] = yz + a * x;                g[8] = 1.0 - b * (x * x + y * y);
  }
}

ROWS so3_log(const double *__restrict g, double *__restrict w, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 9, w += 3) {
    double a = g[0], b = g[4], c = g[8], x, y, z, s;   // four times the quaternion times its largest component
    if (a + b + c >= 0.0) { x = g[7] - g[5]; y = g[2] - g[6]; z = g[3] - g[1]; s = 1.0 + (a + b + c); }
    else if (a >= b && a >= c) { x = 1.0 + (a - b - c); y = g[1] + g[3]; z = g[2] + g[6]; s = g[7] - g[5]; }
    else if (b >= c) { x = g[1] + g[3]; y = 1.0 + (b - c - a); z = g[5] + g[7]; s = g[2] - g[6]; }
    else { x = g[2] + g[6]; y = g[5] + g[7]; z = 1.0 + (c - a - b); s = g[3] - g[1]; }
    double size = std::sqrt(x * x + y * y + z * z), scale = 2.0;
    if (s < 0.0) { x = -x; y = -y; z = -z; s = -s; }
    if (size > 1e-150) scale = 2.0 * std::atan2(size, s) / size; else scale = 2.0 / s;
    w[0] = scale * x; w[1] = scale * y; w[2] = scale * z;
  }
}

ROWS so3_compose(const double *__restrict g, const double *__restrict h, double *__restrict gh, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 9, h += 9, gh += 9)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) gh[3 * j + k] = g[3 * j] * h[k] + g[3 * j + 1] * h[3 + k] + g[3 * j + 2] * h[6 + k];
}

ROWS so3_Ad_star(const double *__restrict g, const double *__restrict mu, double *__restrict moved, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 9, mu += 3, moved += 3)
    for (int k = 0; k < 3; ++k) moved[k] = mu[0] * g[k] + mu[1] * g[3 + k] + mu[2] * g[6 + k];
}

// ---- SE(3) --------------------------------------------------------------------------------------------------------------------------------------

static inline void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0]; }

// v + s w x v + t w x (w x v)
static inline void bent(const double *w, const double *v, double s, double t, double *u) {
  double a[3], b[3]; cross(w, v, a); cross(w, a, b);
  for (int k = 0; k < 3; ++k) u[k] = v[k] + (s * a[k] + t * b[k]); }

ROWS se3_exp(const double *__restrict xi, double *__restrict g, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, xi += 6, g += 16) {
    double R[9], p[3], square = xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2], x = square, b, c;
    so3_exp(xi, R, 1);
    if (x < 0.1) {
      b = 1.0 / 2 - x * (1.0 / 24 - x * (1.0 / 720 - x * (1.0 / 40320 - x * (1.0 / 3628800 - x / 479001600))));
      c = 1.0 / 6 - x * (1.0 / 120 - x * (1.0 / 5040 - x * (1.0 / 362880 - x * (1.0 / 39916800 - x / 6227020800))));
    } else {
      double angle = std::sqrt(square), half = std::sin(0.5 * angle);
      b = 2.0 * half * half / square; c = (angle - std::sin(angle)) / (angle * square);
    }
    bent(xi, xi + 3, b, c, p);
    for (int j = 0; j < 3; ++j) { for (int k = 0; k < 3; ++k) g[4 * j + k] = R[3 * j + k]; g[4 * j + 3] = p[j]; }
    g[12] = g[13] = g[14] = 0.0; g[15] = 1.0;
  }
}

ROWS se3_log(const double *__restrict g, double *__restrict xi, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 16, xi += 6) {
    double R[9], p[3], d;
    for (int j = 0; j < 3; ++j) { for (int k = 0; k < 3; ++k) R[3 * j + k] = g[4 * j + k]; p[j] = g[4 * j + 3]; }
    so3_log(R, xi, 1);
    double x = xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2];
    if (x < 0.1) d = 1.0 / 12 + x * (1.0 / 720 + x * (1.0 / 30240 + x * (1.0 / 1209600 + x * (1.0 / 47900160 + x * (691.0 / 1307674368000.0)))));
    else { double half = 0.5 * std::sqrt(x); d = (1.0 - half / std::tan(half)) / x; }
    bent(xi, p, -0.5, d, xi + 3);
  }
}

ROWS se3_compose(const double *__restrict g, const double *__restrict h, double *__restrict gh, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 16, h += 16, gh += 16) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 4; ++k) gh[4 * j + k] = g[4 * j] * h[k] + g[4 * j + 1] * h[4 + k] + g[4 * j + 2] * h[8 + k];
      gh[4 * j + 3] += g[4 * j + 3];
    }
    gh[12] = gh[13] = gh[14] = 0.0; gh[15] = 1.0;
  }
}

ROWS se3_Ad_star(const double *__restrict g, const double *__restrict mu, double *__restrict moved, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i, g += 16, mu += 6, moved += 6) {
    double p[3] = {g[3], g[7], g[11]}, c[3];
    cross(p, mu + 3, c);
    for (int k = 0; k < 3; ++k) {
      moved[k] = (mu[0] - c[0]) * g[k] + (mu[1] - c[1]) * g[4 + k] + (mu[2] - c[2]) * g[8 + k];
      moved[3 + k] = mu[3] * g[k] + mu[4] * g[4 + k] + mu[5] * g[8 + k];
    }
  }
}
