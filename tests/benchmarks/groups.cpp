// The opponent on SE(3): one step of each integrator for a free body in a fluid and for the heavy top, as fast as we can write it in C++.
//
// Dual vectors, two for a screw w + eps v and two for a momentum P + eps Pi, as in liemech/groups/se3.py; see there for the formulas. What a hand
// knows and a library does not is used: h is folded into the inertia, the matrix of dexp^-1 is ready before the velocity is, the inner stages turn by
// half a step and need shorter polynomials, and the Newton matrix has a constant block with a known inverse. No libm; up to 0.63 rad per step.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract={off,fast} -shared -fPIC

#define INLINE static inline __attribute__((always_inline))

// ---- vectors and matrices -----------------------------------------------------------------------------------------------------------------------

struct Vec { double x, y, z; };
INLINE Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE Vec operator*(Vec a, Vec b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
INLINE Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
INLINE double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

struct Mat { Vec a, b, c; };   // three rows
INLINE Mat operator+(Mat m, Mat n) { return {m.a + n.a, m.b + n.b, m.c + n.c}; }
INLINE Mat operator-(Mat m, Mat n) { return {m.a - n.a, m.b - n.b, m.c - n.c}; }
INLINE Mat operator*(double s, Mat m) { return {s * m.a, s * m.b, s * m.c}; }
INLINE Vec operator*(const Mat &m, Vec v) { return {dot(m.a, v), dot(m.b, v), dot(m.c, v)}; }
INLINE Vec rows(Vec u, const Mat &m) { return {u.x * m.a.x + u.y * m.b.x + u.z * m.c.x, u.x * m.a.y + u.y * m.b.y + u.z * m.c.y, u.x * m.a.z + u.y * m.b.z + u.z * m.c.z}; }
INLINE Mat operator*(const Mat &m, const Mat &n) { return {rows(m.a, n), rows(m.b, n), rows(m.c, n)}; }
INLINE Mat outer(Vec a, Vec b) { return {a.x * b, a.y * b, a.z * b}; }
INLINE Mat hat(Vec w) { return {{0, -w.z, w.y}, {w.z, 0, -w.x}, {-w.y, w.x, 0}}; }
INLINE Mat transposed(Mat m) { return {{m.a.x, m.b.x, m.c.x}, {m.a.y, m.b.y, m.c.y}, {m.a.z, m.b.z, m.c.z}}; }
INLINE Mat plus(Mat m, Vec d) { m.a.x += d.x; m.b.y += d.y; m.c.z += d.z; return m; }
INLINE Mat plus(Mat m, double s) { return plus(m, Vec{s, s, s}); }

// M d = r, Cramer's rule on the columns of M
INLINE Vec solve(Mat m, Vec r) {
  Mat t = transposed(m); Vec bc = cross(t.b, t.c); double k = 1.0 / dot(t.a, bc);
  return {k * dot(r, bc), k * dot(r, cross(t.c, t.a)), k * dot(r, cross(t.a, t.b))}; }

struct Screw { Vec w, v; };
struct Momentum { Vec Pi, P; };
INLINE Screw operator+(Screw a, Screw b) { return {a.w + b.w, a.v + b.v}; }
INLINE Screw operator-(Screw a, Screw b) { return {a.w - b.w, a.v - b.v}; }
INLINE Screw operator*(double s, Screw a) { return {s * a.w, s * a.v}; }

// ---- energies: velocities k_i J^-1 mu for three factors k, and the inertia with its blocks -------------------------------------------------------

struct Diagonal {
  Vec J1, J2, D2; Screw c[3];
  Diagonal(const double *J, const double *, const double (&k)[3]) : J1{J[0], J[1], J[2]}, J2{J[3], J[4], J[5]}, D2{1 / J[3], 1 / J[4], 1 / J[5]} {
    for (int i = 0; i < 3; ++i) c[i] = {k[i] * Vec{1 / J[0], 1 / J[1], 1 / J[2]}, k[i] * D2}; }
  template <int i> INLINE Screw velocity(const Diagonal &e, Momentum m) { return {e.c[i].w * m.Pi, e.c[i].v * m.P}; }
  INLINE Momentum momentum(const Diagonal &e, Screw x) { return {e.J1 * x.w, e.J2 * x.v}; }
  // (s J + [[A, B], [C, 0]]) d = r, t = 1/s
  INLINE Screw solve6(const Diagonal &e, double s, double t, Mat A, Mat B, Mat C, Momentum r) {
    Vec D = t * e.D2; Mat G = {D.x * C.a, D.y * C.b, D.z * C.c}; Vec g = D * r.P;
    Vec x = solve(plus(A, s * e.J1) - B * G, r.Pi - B * g);
    return {x, g - G * x}; } };

struct Full {
  Mat J11, J12, J22, D; Mat c[3][4];
  static Mat block(const double *m, int i, int j) { m += 6 * i + j; return {{m[0], m[1], m[2]}, {m[6], m[7], m[8]}, {m[12], m[13], m[14]}}; }
  Full(const double *J, const double *inverse, const double (&k)[3]) : J11(block(J, 0, 0)), J12(block(J, 0, 3)), J22(block(J, 3, 3)) {
    D = transposed({solve(J22, {1, 0, 0}), solve(J22, {0, 1, 0}), solve(J22, {0, 0, 1})});
    for (int i = 0; i < 3; ++i) for (int j = 0; j < 4; ++j) c[i][j] = k[i] * block(inverse, 3 * (j / 2), 3 * (j % 2)); }
  template <int i> INLINE Screw velocity(const Full &e, Momentum m) { return {e.c[i][0] * m.Pi + e.c[i][1] * m.P, e.c[i][2] * m.Pi + e.c[i][3] * m.P}; }
  INLINE Momentum momentum(const Full &e, Screw x) { return {e.J11 * x.w + e.J12 * x.v, rows(x.w, e.J12) + e.J22 * x.v}; }
  INLINE Screw solve6(const Full &e, double s, double t, Mat A, Mat B, Mat C, Momentum r) {
    B = B + s * e.J12; Mat G = t * (e.D * (C + s * transposed(e.J12))); Vec g = t * (e.D * r.P);
    Vec x = solve((A + s * e.J11) - B * G, r.Pi - B * g);
    return {x, g - G * x}; } };

// H = Pi.J^-1 Pi/2 + Gamma.chi: the momenta are (Pi, Gamma)
struct Top {
  Screw c[3];
  Top(const double *J, const double *, const double (&k)[3]) { for (int i = 0; i < 3; ++i) c[i] = {k[i] * Vec{1 / J[0], 1 / J[1], 1 / J[2]}, k[i] * Vec{J[3], J[4], J[5]}}; }
  template <int i> INLINE Screw velocity(const Top &e, Momentum m) { return {e.c[i].w * m.Pi, e.c[i].v}; } };

// ---- coefficients -------------------------------------------------------------------------------------------------------------------------------
// Stumpff's c_4, c_5 give sin th/th = a, (1 - cos th)/th^2 = b, (th - sin th)/th^3 = c and their derivatives in x = th^2.

template <int n> INLINE double polynomial(const double (&c)[n], double x) {   // Estrin's scheme
  static_assert(n >= 3 && n <= 7, "");
  double y = x * x;
  if constexpr (n == 3) return (c[0] + x * c[1]) + y * c[2];
  else if constexpr (n == 4) return (c[0] + x * c[1]) + y * (c[2] + x * c[3]);
  else {
    double p = (c[0] + x * c[1]) + y * (c[2] + x * c[3]);
    if constexpr (n == 5) return p + (y * y) * c[4];
    else if constexpr (n == 6) return p + (y * y) * (c[4] + x * c[5]);
    else return p + (y * y) * ((c[4] + x * c[5]) + y * c[6]); } }

// x <= 0.4, relative error 1e-17 (docs/derivations/rotation_polynomials.py)
constexpr double stumpff4[] = {0.041666666666666664, -0.001388888888888889, 2.480158730158839e-05, -2.7557319224724247e-07, 2.0876757146334453e-09, -1.1470719729895683e-11, 4.764673072706606e-14};
constexpr double stumpff5[] = {0.008333333333333333, -0.0001984126984126984, 2.755731922398578e-06, -2.505210838524148e-08, 1.6059043681290294e-10, -7.64710385181737e-13, 2.800217162164268e-15};
// x <= 0.1, Taylor: error of b and c 1e-18
constexpr double half_stumpff4[] = {1 / 24., -1 / 720., 1 / 40320., -1 / 3628800., 1 / 479001600., -1 / 87178291200.};
constexpr double half_stumpff5[] = {1 / 120., -1 / 5040., 1 / 362880., -1 / 39916800., 1 / 6227020800.};
// second derivatives of b and c; they only steer Newton: error 1e-9
constexpr double b_curvature[] = {1 / 360., -6 / 40320., 12 / 3628800., -20 / 479001600.};
constexpr double c_curvature[] = {2 / 5040., -6 / 362880., 12 / 39916800.};

struct Coefficients { double a, b, c, da, db, dc; };   // and the derivatives
template <int m, int n> INLINE Coefficients coefficients(const double (&s4)[m], const double (&s5)[n], double x) {
  double c4 = polynomial(s4, x), c5 = polynomial(s5, x), b = 0.5 - x * c4, c = 1 / 6. - x * c5;
  return {1.0 - x * c, b, c, 0.5 * (c - b), c4 - 0.5 * c, 1.5 * c5 - 0.5 * c4}; }

// ---- motions ------------------------------------------------------------------------------------------------------------------------------------

struct Body { Momentum m; Mat R; Vec p; Screw x, x1, x2; };

// Ad*_exp(x) m = m - a x x m + b x x (x x m) over dual numbers, k the coefficients at |w|^2
INLINE Momentum transported(Screw x, double wv, Coefficients k, Momentum m) {
  Vec y = cross(x.w, m.P), dy = cross(x.w, m.Pi) + cross(x.v, m.P), z = cross(x.w, y), dz = cross(x.w, dy) + cross(x.v, y);
  double s = wv + wv; Vec sy = s * y, sz = s * z;
  return {(m.Pi + (k.b * dz - k.a * dy)) + (k.db * sz - k.da * sy), m.P + (k.b * z - k.a * y)}; }

// R + R (s W + b W^2), p + R q
INLINE void move(Body &o, Vec w, double s, double b, Vec q) {
  Vec u = b * w, t = s * w; double xy = u.x * w.y, yz = u.y * w.z, zx = u.z * w.x, xx = u.x * w.x, yy = u.y * w.y, zz = u.z * w.z;
  Mat E = {{-(yy + zz), xy - t.z, zx + t.y}, {xy + t.z, -(xx + zz), yz - t.x}, {zx - t.y, yz + t.x, -(xx + yy)}};
  o.p = o.p + o.R * q; o.R = o.R + o.R * E; }

INLINE Vec displacement(Screw x, Coefficients k) { Vec y = cross(x.w, x.v); return x.v + (k.b * y + k.c * cross(x.w, y)); }

// ---- RKMK4, q = 2 -------------------------------------------------------------------------------------------------------------------------------

template <class Energy> struct Rkmk4 {
  Energy e; double scale = 1;
  Rkmk4(const double *J, const double *inverse, double h) : e(J, inverse, {h / 2, h, h / 6}) {}
  INLINE void start(Body &, const Rkmk4 &) {}

  // the matrix A + eps B of 1 + ad/2 + ad^2/12 is ready before the coefficients are
  template <int i, int m, int n> INLINE Screw stage(const Rkmk4 &o, const double (&s4)[m], const double (&s5)[n], Screw x, Momentum mu) {
    double ww = dot(x.w, x.w), wv = dot(x.w, x.v);
    Screw k = Energy::template velocity<i>(o.e, transported(x, wv, coefficients(s4, s5, ww), mu));
    Screw y = {cross(x.w, k.w), cross(x.w, k.v) + cross(x.v, k.w)}, u = 0.5 * k + (1 / 12.) * y; return k + Screw{cross(x.w, u.w), cross(x.w, u.v) + cross(x.v, u.w)}; }

  template <bool pose> INLINE long step(Body &o, const Rkmk4 &k) {
    Screw k1 = Energy::template velocity<0>(k.e, o.m);
    Screw k2 = stage<0>(k, half_stumpff4, half_stumpff5, k1, o.m), k3 = stage<1>(k, half_stumpff4, half_stumpff5, k2, o.m);
    Screw x = (1 / 3.) * ((k1 + k3) + (k2 + k2)) + stage<2>(k, stumpff4, stumpff5, k3, o.m);
    double ww = dot(x.w, x.w); Coefficients c = coefficients(stumpff4, stumpff5, ww);
    o.m = transported(x, dot(x.w, x.v), c, o.m);
    if (pose) move(o, x.w, c.a, c.b, displacement(x, c));
    return 0; }
};

// ---- Algorithm 1 --------------------------------------------------------------------------------------------------------------------------------
// Newton starts from the quadratically extrapolated velocity; when the residual is below 2^-30 |mu| the correction in hand is the last one.

constexpr double enough = 0x1p-60;

template <class Step> INLINE long newton(Step step) { long n = 0; bool active; do { active = step(); ++n; } while (active && n < 50); return n; }
INLINE Screw extrapolated(const Body &o) { return 3.0 * o.x + (o.x2 - 3.0 * o.x1); }
INLINE void remember(Body &o, Screw x) { o.x2 = o.x1; o.x1 = o.x; o.x = x; }

// Momentum scaled by h, x = h xi:  J x = (dexp_x)* m
template <class Energy> struct Exponential {
  Energy e; double scale;
  Exponential(const double *J, const double *inverse, double h) : e(J, inverse, {1, 1, 1}), scale(h) {}
  INLINE void start(Body &o, const Exponential &k) { o.x = o.x1 = o.x2 = Energy::template velocity<0>(k.e, o.m); }
  template <bool pose> INLINE long step(Body &o, const Exponential &k) {
    Screw x = extrapolated(o); Vec P = o.m.P, Pi = o.m.Pi; double bound = enough * (dot(P, P) + dot(Pi, Pi)); Coefficients f;
    long n = newton([&]() __attribute__((always_inline)) {
      Vec w = x.w, v = x.v; double ww = dot(w, w), q = 2.0 * dot(w, v);
      f = coefficients(stumpff4, stumpff5, ww);
      double da = q * f.da, db = q * f.db, dc = q * f.dc, db1 = q * polynomial(b_curvature, ww), dc1 = q * polynomial(c_curvature, ww);
      double s = dot(w, P), ds = dot(w, Pi) + dot(v, P), cs = f.c * s, dcs = f.c * ds + dc * s;
      Vec y = cross(w, P), dy = cross(w, Pi) + cross(v, P);
      Momentum r = Energy::momentum(k.e, x);
      r.P = (r.P - f.a * P) + (f.b * y - cs * w);
      r.Pi = (r.Pi - (f.a * Pi + da * P)) + ((f.b * dy + db * y) - (cs * v + dcs * w));
      Vec along = (f.b - f.c) * P + 2.0 * (f.db * y - (f.dc * s) * w);
      Vec dalong = ((f.b - f.c) * Pi + (db - dc) * P) + 2.0 * ((f.db * dy + db1 * y) - ((f.dc * s) * v + (f.dc * ds + dc1 * s) * w));
      Mat A = plus((outer(along, w) - outer(f.c * w, P)) - hat(f.b * P), -cs);
      Mat B = plus(((outer(dalong, w) + outer(along, v)) - (outer(f.c * v + dc * w, P) + outer(f.c * w, Pi))) - hat(f.b * Pi + db * P), -dcs);
      x = x - Energy::solve6(k.e, 1.0, 1.0, B, A, A, r);
      return dot(r.Pi, r.Pi) + dot(r.P, r.P) > bound; });
    remember(o, x);
    f = coefficients(stumpff4, stumpff5, dot(x.w, x.w));
    o.m = transported(x, dot(x.w, x.v), f, o.m);
    if (pose) move(o, x.w, f.a, f.b, displacement(x, f));
    return n; }
};

// Momentum scaled by h/2, x = h xi/2, N = Pi - v x P, q = 1 + |w|^2:  q (l, p) = (N - w x N, P - w x P + w (w.P)) with (l, p) = J x
template <class Energy> struct Cayley {
  Energy e; double scale;
  Cayley(const double *J, const double *inverse, double h) : e(J, inverse, {1, 1, 1}), scale(0.5 * h) {}
  INLINE void start(Body &o, const Cayley &k) { o.x = o.x1 = o.x2 = Energy::template velocity<0>(k.e, o.m); }
  template <bool pose> INLINE long step(Body &o, const Cayley &k) {
    Screw x = extrapolated(o); Vec P = o.m.P, Pi = o.m.Pi; double bound = enough * (dot(P, P) + dot(Pi, Pi));
    long n = newton([&]() __attribute__((always_inline)) {
      Vec w = x.w, v = x.v, N = Pi - cross(v, P); double q = 1.0 + dot(w, w), s = dot(w, P), t = 1.0 / q;
      Momentum l = Energy::momentum(k.e, x), r;
      r.Pi = (q * l.Pi - N) + cross(w, N);
      r.P = (q * l.P - P) + (cross(w, P) - s * w);
      Mat A = outer(l.Pi + l.Pi, w) - hat(N), B = plus(outer(P, w) - hat(P), -s), C = plus((outer(l.P + l.P, w) - outer(w, P)) - hat(P), -s);
      x = x - Energy::solve6(k.e, q, t, A, B, C, r);
      return dot(r.Pi, r.Pi) + dot(r.P, r.P) > (q * q) * bound; });
    remember(o, x);
    Vec w = x.w; double f = 2.0 / (1.0 + dot(w, w)); Vec q = f * (x.v + (cross(w, x.v) + dot(w, x.v) * w));
    Vec M = Pi - cross(q, P), y = cross(w, M), z = cross(w, P);
    o.m = {M + f * (cross(w, y) - y), P + f * (cross(w, z) - z)};
    if (pose) move(o, w, f, f, q);
    return n; }
};

// ---- marching -----------------------------------------------------------------------------------------------------------------------------------
// Momentum (Pi, P) and the upper three rows of [[R, p], [0, 1]].

template <class Method, bool pose> static __attribute__((noinline)) long march(double *mu, double *g, const double *J, const double *inverse, double h, long steps) {
  const Method method(J, inverse, h); Body o; long solves = 0; const double s = method.scale;
  o.m = {s * Vec{mu[0], mu[1], mu[2]}, s * Vec{mu[3], mu[4], mu[5]}};
  if (pose) { o.R = {{g[0], g[1], g[2]}, {g[4], g[5], g[6]}, {g[8], g[9], g[10]}}; o.p = {g[3], g[7], g[11]}; }
  Method::start(o, method);
  for (long j = 0; j < steps; ++j) solves += Method::template step<pose>(o, method);
  const Vec a = (1 / s) * o.m.Pi, b = (1 / s) * o.m.P, rest[] = {o.R.a, o.R.b, o.R.c};
  mu[0] = a.x; mu[1] = a.y; mu[2] = a.z; mu[3] = b.x; mu[4] = b.y; mu[5] = b.z;
  if (pose) {
    for (int i = 0; i < 3; ++i) { g[4 * i] = rest[i].x; g[4 * i + 1] = rest[i].y; g[4 * i + 2] = rest[i].z; }
    g[3] = o.p.x; g[7] = o.p.y; g[11] = o.p.z; }
  return solves; }

template <class Method> static long dispatch(double *mu, double *g, const double *J, const double *inverse, double h, long steps) {
  return g ? march<Method, true>(mu, g, J, inverse, h, steps) : march<Method, false>(mu, g, J, inverse, h, steps); }

// Advance one body by `steps` steps of length h; returns the number of Newton solves. kind: 0 inertia (6), 1 inertia (6, 6) and its inverse, 2 the top.
extern "C" long advance_se3(int method, int kind, double *mu, double *g, const double *J, const double *inverse, double h, long steps) {
  switch (10 * method + kind) {
    case 0: return dispatch<Rkmk4<Diagonal>>(mu, g, J, inverse, h, steps);
    case 1: return dispatch<Rkmk4<Full>>(mu, g, J, inverse, h, steps);
    case 2: return dispatch<Rkmk4<Top>>(mu, g, J, inverse, h, steps);
    case 10: return dispatch<Cayley<Diagonal>>(mu, g, J, inverse, h, steps);
    case 11: return dispatch<Cayley<Full>>(mu, g, J, inverse, h, steps);
    case 20: return dispatch<Exponential<Diagonal>>(mu, g, J, inverse, h, steps);
    case 21: return dispatch<Exponential<Full>>(mu, g, J, inverse, h, steps);
  }
  return -1; }
