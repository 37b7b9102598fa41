// The opponent: one step of each integrator for the free rigid body and the heavy top, as fast as we can write it in C++.
//
// Every formula is written once, for T = double (one body) and T = Lanes<K> (8 K bodies in SIMD lanes). No libm, no square root, no division by
// the inertia in a step: the coefficients of exp and dexp^-1 are polynomials in the squared angle, good to rounding for turns up to sqrt 2 per step.
// Row i of the attitude R moves as the momentum does (R <- R exp(hat v) and mu <- exp(-hat v) mu), so one rotation serves all four vectors.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract={off,fast} -shared -fPIC

#include <cstring>
#ifdef __AVX512F__
#include <immintrin.h>
#endif

#define INLINE static inline __attribute__((always_inline))

// ---- SIMD lanes ---------------------------------------------------------------------------------------------------------------------------------

#ifdef __AVX512F__
constexpr int width = 8;
#else
constexpr int width = 4;
#endif
typedef double Reg __attribute__((vector_size(8 * width)));
typedef long long Bits __attribute__((vector_size(8 * width)));

template <int K> struct Lanes { Reg v[K]; };   // K registers: independent chains hide the latency of each other
template <int K> struct Mask { Bits v[K]; };

#define EACH _Pragma("GCC unroll 4") for (int k = 0; k < K; ++k)
#define BINARY(op) \
  template <int K> INLINE Lanes<K> operator op(Lanes<K> a, Lanes<K> b) { Lanes<K> c; EACH c.v[k] = a.v[k] op b.v[k]; return c; } \
  template <int K> INLINE Lanes<K> operator op(Lanes<K> a, double b) { Lanes<K> c; EACH c.v[k] = a.v[k] op b; return c; } \
  template <int K> INLINE Lanes<K> operator op(double a, Lanes<K> b) { Lanes<K> c; EACH c.v[k] = a op b.v[k]; return c; }
BINARY(+) BINARY(-) BINARY(*) BINARY(/)
template <int K> INLINE Lanes<K> operator-(Lanes<K> a) { EACH a.v[k] = -a.v[k]; return a; }
template <int K> INLINE Mask<K> operator>(Lanes<K> a, Lanes<K> b) { Mask<K> m; EACH m.v[k] = a.v[k] > b.v[k]; return m; }
template <int K> INLINE Mask<K> operator&(Mask<K> a, Mask<K> b) { EACH a.v[k] &= b.v[k]; return a; }
template <int K> INLINE Lanes<K> where(Mask<K> m, Lanes<K> a, Lanes<K> b) { EACH a.v[k] = m.v[k] ? a.v[k] : b.v[k]; return a; }
template <int K> INLINE bool any(Mask<K> m) {
  Bits b = m.v[0]; for (int k = 1; k < K; ++k) b |= m.v[k];
#ifdef __AVX512F__
  return _mm512_test_epi64_mask((__m512i)b, (__m512i)b);
#else
  long long s = 0; _Pragma("GCC unroll 8") for (int i = 0; i < width; ++i) s |= b[i];
  return s;
#endif
}
INLINE double where(bool m, double a, double b) { return m ? a : b; }
INLINE bool any(bool m) { return m; }

template <class T> struct Traits { typedef bool Active; static constexpr int lanes = 1; INLINE bool all() { return true; } };
template <int K> struct Traits<Lanes<K>> { typedef Mask<K> Active; static constexpr int lanes = K * width;
  INLINE Mask<K> all() { Mask<K> m; EACH m.v[k] = ~Bits{}; return m; } };

// ---- vectors ------------------------------------------------------------------------------------------------------------------------------------

template <class T> struct Vec { T x, y, z; };
typedef Vec<double> Triple;
template <class A, class B> INLINE auto operator*(Vec<A> a, Vec<B> b) -> Vec<decltype(a.x * b.x)> { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class T> INLINE Vec<T> operator+(Vec<T> a, Vec<T> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class T> INLINE Vec<T> operator-(Vec<T> a, Vec<T> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class T> INLINE Vec<T> operator-(Vec<T> a) { return {-a.x, -a.y, -a.z}; }
template <class T, class M> INLINE Vec<T> where(M m, Vec<T> a, Vec<T> b) { return {where(m, a.x, b.x), where(m, a.y, b.y), where(m, a.z, b.z)}; }
template <class T> INLINE Vec<T> operator*(T s, Vec<T> a) { return {s * a.x, s * a.y, s * a.z}; }
template <int K> INLINE Vec<Lanes<K>> operator*(double s, Vec<Lanes<K>> a) { return {s * a.x, s * a.y, s * a.z}; }
template <class A, class B> INLINE auto dot(Vec<A> a, Vec<B> b) -> decltype(a.x * b.x) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T> INLINE Vec<T> cross(Vec<T> a, Vec<T> b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

template <class T> struct Mat { Vec<T> a, b, c; };   // three rows
template <class T> INLINE Vec<T> operator*(Mat<T> m, Vec<T> p) { return {dot(m.a, p), dot(m.b, p), dot(m.c, p)}; }

// Solution of [a b c] d = r (a, b, c columns), Cramer's rule.
template <class T> INLINE Vec<T> solve(Vec<T> a, Vec<T> b, Vec<T> c, Vec<T> r) {
  Vec<T> bc = cross(b, c); T k = 1.0 / dot(a, bc);
  return {k * dot(r, bc), k * dot(r, cross(c, a)), k * dot(r, cross(a, b))}; }

// ---- coefficients of exp and dexp^-1 ------------------------------------------------------------------------------------------------------------
// A rotation is given by half its vector, g = theta n/2, and its polynomials by x = |g|^2 = theta^2/4: the halves and quarters of the formulas vanish
// into the coefficients. Interpolation at Chebyshev nodes stretched so that the lowest is x = 0, hence the constant term is exact.

// sum c_k x^k: short chain (Estrin) for one body, few operations (Horner) for lanes
template <class T, int n> INLINE T polynomial(const double (&c)[n], T x) {
  static_assert(n >= 4 && n <= 8, "");
  if (Traits<T>::lanes > 1) {
    T p = c[n - 2] + x * c[n - 1];
    _Pragma("GCC unroll 8") for (int k = n - 3; k >= 0; --k) p = c[k] + x * p;
    return p; }
  T y = x * x, p = (c[0] + x * c[1]) + y * (c[2] + x * c[3]);
  if constexpr (n == 6) p = p + (y * y) * (c[4] + x * c[5]);
  if constexpr (n == 7) p = p + (y * y) * ((c[4] + x * c[5]) + y * c[6]);
  if constexpr (n == 8) p = p + (y * y) * ((c[4] + x * c[5]) + y * (c[6] + x * c[7]));
  return p; }

// sin theta/(theta/2), theta^2 <= 2: error 9e-17
constexpr double sine[] = {2.0, -1.3333333333333257, 0.2666666666662821, -0.025396825390182957, 0.0014109346898601093, -5.1306479520205735e-05, 1.314982013589872e-06, -2.4338341164585988e-08};
// (1 - cos theta)/(theta/2)^2, theta^2 <= 2: error 2e-17
constexpr double versine[] = {2.0, -0.6666666666666659, 0.08888888888884607, -0.006349206348466636, 0.000282186942795117, -8.551093113049565e-06, 1.8787270584833623e-07, -3.052181032292997e-09};
// the same for theta^2 <= 1/2; the inner stages turn by half a step: error 7e-18
constexpr double half_sine[] = {2.0, -1.3333333333333326, 0.26666666666654426, -0.025396825390485427, 0.0014109345932686666, -5.130489930226714e-05, 1.3047748441872699e-06};
// and: error 4e-16
constexpr double half_versine[] = {2.0, -0.6666666666665261, 0.0888888888729409, -0.006349205761776742, 0.00028217750337936764, -8.482131380455825e-06};
// d = (1 - (theta/2) cot(theta/2))/(theta/2)^2, theta^2 <= 2: error 4e-16
constexpr double dexp_inv[] = {0.3333333333333333, 0.02222222222228, 0.0021164021134587414, 0.000211640262257599, 2.137738755102675e-05, 2.1661867100506534e-06, 2.1505215542895415e-07, 2.725838603841374e-08};
// dd/dx; it only steers Newton: error 7e-09
constexpr double dexp_inv_slope[] = {0.022222222222222223, 0.004233083881145545, 0.0006315604060809449, 9.681438573977821e-05};

template <class T> struct Pair { T s, b; };
template <class T> INLINE Pair<T> rotation(T x) { return {polynomial(sine, x), polynomial(versine, x)}; }
template <class T> INLINE Pair<T> half_rotation(T x) { return {polynomial(half_sine, x), polynomial(half_versine, x)}; }

// ---- rotations: p + s g x p + b g x (g x p) -----------------------------------------------------------------------------------------------------

template <class T> INLINE Vec<T> rotate(Vec<T> g, Pair<T> k, Vec<T> p) { Vec<T> c = cross(g, p), d = cross(g, c); return (p + k.s * c) + k.b * d; }

template <class T> INLINE Mat<T> matrix(Vec<T> g, T x, Pair<T> k) {
  Vec<T> s = k.s * g, b = k.b * g; T c = 1.0 - k.b * x, xy = b.x * g.y, yz = b.y * g.z, zx = b.z * g.x;
  return {{c + b.x * g.x, xy - s.z, zx + s.y}, {xy + s.z, c + b.y * g.y, yz - s.x}, {zx - s.y, yz + s.x, c + b.z * g.z}}; }

template <class T> struct Past { Vec<T> w, w1, w2; };
template <class T> struct Body : Past<T> { Vec<T> p; T y, y1, y2, y3; Mat<T> R; Past<T> substeps[5]; Vec<T> kick; };   // each method keeps what it needs

// Momentum and rows of the attitude by the same rotation. One body waits for latency and takes the short way for p; lanes count operations.
template <bool attitude, class T> INLINE void move(Body<T> &s, Vec<T> g, T x, Pair<T> k) {
  if (!attitude) { s.p = rotate(g, k, s.p); return; }
  Mat<T> E = matrix(g, x, k);
  s.p = Traits<T>::lanes == 1 ? rotate(g, k, s.p) : E * s.p;
  s.R = {E * s.R.a, E * s.R.b, E * s.R.c}; }

// the same by cay(2g), where s = b = f
template <bool attitude, class T> INLINE void move_cayley(Body<T> &s, Vec<T> g, T x, T f) {
  if (attitude) { Mat<T> E = matrix(g, x, Pair<T>{f, f}); s.R = {E * s.R.a, E * s.R.b, E * s.R.c}; if (Traits<T>::lanes > 1) { s.p = E * s.p; return; } }
  Vec<T> c = cross(g, s.p); s.p = s.p + f * (c + cross(g, c)); }

// ---- RKMK4: mu = exp(Om) mu_n, Om' = dexp^-1_Om(-J^-1 mu), q = 2 --------------------------------------------------------------------------------
// With g = Om/2:  dexp^-1 a = a - g x a + g x (g x a)/3.

struct Rkmk4 {
  Triple c, c2, c3; double scale = 1;   // c = -h/(4 J): half of K h/2
  Rkmk4(const double *J, double h) : c{-0.25 * h / J[0], -0.25 * h / J[1], -0.25 * h / J[2]}, c2{2 * c.x, 2 * c.y, 2 * c.z}, c3{c.x / 3, c.y / 3, c.z / 3} {}
  template <class T> INLINE void start(Body<T> &, const Rkmk4 &) {}

  // dexp^-1_g c rot(g) p. For one body the matrix of dexp^-1_g c is ready before the polynomials are.
  template <class T> INLINE Vec<T> stage(Triple c, Vec<T> g, T x, Pair<T> k, Vec<T> p) {
    if (Traits<T>::lanes > 1) { Vec<T> a = c * rotate(g, k, p); return a - cross(g, a - (1 / 3.) * cross(g, a)); }
    Vec<T> t = (1 / 3.) * g; T e = 1.0 - (1 / 3.) * x, xy = t.x * g.y, yz = t.y * g.z, zx = t.z * g.x;
    Mat<T> D = {Vec<T>{e + t.x * g.x, xy + g.z, zx - g.y} * c, Vec<T>{xy - g.z, e + t.y * g.y, yz + g.x} * c, Vec<T>{zx + g.y, yz - g.x, e + t.z * g.z} * c};
    return D * rotate(g, k, p); }

  template <bool attitude, class T> INLINE int step(Body<T> &s, const Rkmk4 &m) {
    Vec<T> g1 = m.c * s.p; T x = dot(g1, g1);
    Vec<T> g2 = stage(m.c, g1, x, half_rotation(x), s.p); x = dot(g2, g2);
    Vec<T> g3 = stage(m.c2, g2, x, half_rotation(x), s.p); x = dot(g3, g3);
    Vec<T> g = (1 / 3.) * ((g1 + g3) + (g2 + g2)) + stage(m.c3, g3, x, rotation(x), s.p); x = dot(g, g);
    move<attitude>(s, g, x, rotation(x)); return 0; }
};

// ---- Algorithm 1: (dtau^-1_{h xi})^* J xi = mu_n, mu_{n+1} = Ad*_{tau(h xi)} mu_n ---------------------------------------------------------------
// Newton starts from the quadratically extrapolated velocity; when the residual is below 2^-30 |mu| the correction in hand is the last one.

constexpr double enough = 0x1p-60;   // (2^-30)^2

// count > 0: that many Newton steps; count = 0: until the stop rule holds, lanes frozen as they converge
template <int count, class T, class Step> INLINE int newton(Step step) {
  if (count) { for (int i = 0; i < count; ++i) step(Traits<T>::all()); return count; }
  typename Traits<T>::Active active = Traits<T>::all(); int n = 0;
  do { active = active & step(active); ++n; } while (any(active) && n < 20);
  return n; }

template <class T> INLINE void remember(Body<T> &s, Vec<T> w) { s.w2 = s.w1; s.w1 = s.w; s.w = w; }
template <class T> INLINE Vec<T> extrapolate(const Body<T> &s) { return 3.0 * s.w + (s.w2 - 3.0 * s.w1); }

// The march scales the momentum to m = h mu/2; w = h xi/2, L = J w.

// Cayley: (1 + |w|^2) L + w x m = m, which is (6') times (dcay)^*; its Jacobian is cheaper than that of (6').
template <int count> struct Cayley {
  Triple J, c; double scale;
  Cayley(const double *a, double h) : J{a[0], a[1], a[2]}, c{1 / J.x, 1 / J.y, 1 / J.z}, scale(0.5 * h) {}
  template <class T> INLINE void start(Body<T> &s, const Cayley &k) { s.w = s.w1 = s.w2 = k.c * s.p; }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const Cayley &k) {
    Vec<T> w = extrapolate(s), m = s.p; T bound = enough * dot(m, m);
    int n = newton<count, T>([&](typename Traits<T>::Active active) __attribute__((always_inline)) {
      Vec<T> L = k.J * w, v = w + w; T q = 1.0 + dot(w, w);
      Vec<T> r = (q * L + cross(w, m)) - m;
      Vec<T> a = {q * k.J.x + L.x * v.x, L.y * v.x - m.z, L.z * v.x + m.y};
      Vec<T> b = {L.x * v.y + m.z, q * k.J.y + L.y * v.y, L.z * v.y - m.x};
      Vec<T> c = {L.x * v.z - m.y, L.y * v.z + m.x, q * k.J.z + L.z * v.z};
      w = count ? w - solve(a, b, c, r) : where(active, w - solve(a, b, c, r), w);
      return dot(r, r) > bound; });
    remember(s, w);
    T x = dot(w, w);
    move_cayley<attitude>(s, -w, x, 2.0 / (1.0 + x)); return n; }
};

// The same map with one scalar unknown, y = |w|^2. For given q = 1 + y the equation is linear, (q J - hat m) w = m, and
// w = (q^2 C m + |m|^2 m + q Jm x m) / (q (q^2 det J + m.Jm)), C = cofactors of J; there remains |w(q)|^2 = y, contracting (it needs 2 y < 1 or so).
// An error e of y leaves about 3 y e^2 after one Newton step: stop at e^2 y <= 2^-56. Cubic extrapolation mostly saves the second step.
template <int count> struct CayleyScalar {
  Triple J, C, CC, JJ; double det, twist, scale;
  CayleyScalar(const double *a, double h) : J{a[0], a[1], a[2]}, C{J.y * J.z, J.z * J.x, J.x * J.y}, CC(C * C), JJ(J * J), det(J.x * J.y * J.z),
    twist(2 * (C.x * (J.y - J.z) + C.y * (J.z - J.x) + C.z * (J.x - J.y))), scale(0.5 * h) {}
  template <class T> INLINE void start(Body<T> &s, const CayleyScalar &k) {
    Vec<T> w = Vec<double>{1 / k.J.x, 1 / k.J.y, 1 / k.J.z} * s.p; s.y = s.y1 = s.y2 = s.y3 = dot(w, w); }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const CayleyScalar &k) {
    Vec<T> m = s.p, mm = m * m; T y = 4.0 * s.y + ((4.0 * s.y2 - 6.0 * s.y1) - s.y3);
    T M = mm.x + mm.y + mm.z, e = dot(k.J, mm), n4 = dot(k.CC, mm), n2 = (M + M) * dot(k.C, mm) + (M * dot(k.JJ, mm) - e * e), n0 = M * M * M;
    T n3 = k.twist * (m.x * m.y * m.z);
    int n = newton<count, T>([&](typename Traits<T>::Active active) __attribute__((always_inline)) {
      T q = 1.0 + y, qq = q * q, E = qq * k.det + e, F = q * E, G = F * F;
      T P = y * G - ((n0 + qq * n2) + (qq * q) * (n3 + q * n4));
      T slope = (G + (y + y) * F * (E + (2 * k.det) * qq)) - q * ((n2 + n2) + q * (3.0 * n3 + q * (4.0 * n4)));
      y = count ? y - P / slope : where(active, y - P / slope, y);
      return P * P * y > 0x1p-56 * (G * G); });
    s.y3 = s.y2; s.y2 = s.y1; s.y1 = s.y; s.y = y;
    T q = 1.0 + y, qq = q * q, E = qq * k.det + e, D = 1.0 / (q * E);
    Vec<T> w = D * ((qq * (k.C * m) + M * m) + q * cross(k.J * m, m));
    T x = dot(w, w), f = 2.0 * (E * D);   // 2/(1 + y) but for rounding; one Newton step makes it 2/(1 + |w|^2), or |mu| would drift
    move_cayley<attitude>(s, -w, x, f + f * (1.0 - 0.5 * f * (1.0 + x))); return n; }
};

// Exponential: L + c + d v = m with c = w x L, v = w x c; Jacobian (1 - d x) J + d (w.L) I + hat w J - hat L - 2 d hat c + 2 d' v w^T.
template <int count> struct Exponential {
  Triple J, c; double scale;
  Exponential(const double *a, double h) : J{a[0], a[1], a[2]}, c{1 / J.x, 1 / J.y, 1 / J.z}, scale(0.5 * h) {}
  template <class T> INLINE void start(Body<T> &s, const Exponential &k) { s.w = s.w1 = s.w2 = k.c * s.p; }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const Exponential &k) {
    Vec<T> w = extrapolate(s), m = s.p; T bound = enough * dot(m, m);
    int n = newton<count, T>([&](typename Traits<T>::Active active) __attribute__((always_inline)) {
      Vec<T> L = k.J * w, c = cross(w, L), v = cross(w, c);
      T x = dot(w, w), d = polynomial(dexp_inv, x), slope = polynomial(dexp_inv_slope, x), e = d * dot(w, L), f = 1.0 - d * x;
      Vec<T> r = ((L - m) + c) + d * v, z = L + (d + d) * c, t = (slope + slope) * v;
      Vec<T> A = {(f * k.J.x + e) + t.x * w.x, (w.z * k.J.x - z.z) + t.y * w.x, (z.y - w.y * k.J.x) + t.z * w.x};
      Vec<T> B = {(z.z - w.z * k.J.y) + t.x * w.y, (f * k.J.y + e) + t.y * w.y, (w.x * k.J.y - z.x) + t.z * w.y};
      Vec<T> C = {(w.y * k.J.z - z.y) + t.x * w.z, (z.x - w.x * k.J.z) + t.y * w.z, (f * k.J.z + e) + t.z * w.z};
      w = count ? w - solve(A, B, C, r) : where(active, w - solve(A, B, C, r), w);
      return dot(r, r) > bound; });
    remember(s, w);
    T x = dot(w, w);
    move<attitude>(s, -w, x, rotation(x)); return n; }
};

// ---- Hamilton-Jacobi of order 4, exp: (dexp^-1_x)^* p = mu_n with x = h v + (h^3/6) ds_3(p), mu_{n+1} = Ad*_{exp x} mu_n ---------------------------------
// Along principal axes, K = J^-1, s_3 = w.Kw/4 with w = p x Kp is (e_1 p_2^2 p_3^2 + e_2 p_3^2 p_1^2 + e_3 p_1^2 p_2^2)/4, e_1 = K_1 (K_3 - K_2)^2 and so on.
// Momenta scaled by h/2, g = x/2 = D p with D = K + (e_2 p_3^2 + e_3 p_2^2, ...)/3; the residual is p - m + c + d v, c = g x p, v = g x c.

struct HamiltonJacobi {
  Triple K, e; double scale;
  HamiltonJacobi(const double *J, double h) : K{1 / J[0], 1 / J[1], 1 / J[2]}, scale(0.5 * h) {
    Triple d = {K.z - K.y, K.x - K.z, K.y - K.x}; e = (1 / 3.) * (K * (d * d)); }
  template <class T> INLINE void start(Body<T> &s, const HamiltonJacobi &) { s.w = s.w1 = s.w2 = s.p - s.p; }
  template <class T> INLINE Vec<T> slopes(const HamiltonJacobi &k, Vec<T> p) {
    Vec<T> y = p * p; return {k.K.x + (k.e.y * y.z + k.e.z * y.y), k.K.y + (k.e.z * y.x + k.e.x * y.z), k.K.z + (k.e.x * y.y + k.e.y * y.x)}; }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const HamiltonJacobi &k) {
    Vec<T> m = s.p, p = m + extrapolate(s); T bound = enough * dot(m, m);
    int n = newton<0, T>([&](typename Traits<T>::Active active) __attribute__((always_inline)) {
      Vec<T> D = slopes(k, p), g = D * p, c = cross(g, p), v = cross(g, c);
      T x = dot(g, g), d = polynomial(dexp_inv, x), slope = polynomial(dexp_inv_slope, x), a = d * dot(g, p);
      Vec<T> r = ((p - m) + c) + d * v, z = p + d * c, t = (slope + slope) * v - d * p, dg = d * g, q = (k.e + k.e) * Vec<T>{p.y * p.z, p.z * p.x, p.x * p.y};
      T f = 1.0 - d * x;   // 1 + hat g + d hat g^2, and (a - hat z + t g^T) times dg/dp = [[D_1, q_3, q_2], [q_3, D_2, q_1], [q_2, q_1, D_3]]
      Vec<T> A = {D.x, q.z, q.y}, B = {q.z, D.y, q.x}, C = {q.y, q.x, D.z};
      A = (a * A - cross(z, A)) + (dot(g, A) * t + Vec<T>{f + dg.x * g.x, g.z + dg.x * g.y, dg.x * g.z - g.y});
      B = (a * B - cross(z, B)) + (dot(g, B) * t + Vec<T>{dg.y * g.x - g.z, f + dg.y * g.y, g.x + dg.y * g.z});
      C = (a * C - cross(z, C)) + (dot(g, C) * t + Vec<T>{g.y + dg.z * g.x, dg.z * g.y - g.x, f + dg.z * g.z});
      p = where(active, p - solve(A, B, C, r), p);
      return dot(r, r) > bound; });
    remember(s, p - m);
    Vec<T> g = slopes(k, p) * p; T x = dot(g, g);
    move<attitude>(s, -g, x, rotation(x)); return n; }
};

// ---- Suzuki's composition: substeps a, a, 1 - 4 a, a, a, each beginning with what it remembers of its like in the steps before -------------------
// The momentum stays scaled by h: a substep of length a h is one of length h with the inertia J/a.

struct Scaled { double J[3]; Scaled(const double *a, double k) : J{k * a[0], k * a[1], k * a[2]} {} };

template <class Base> struct Suzuki {
  static constexpr double share = 0.41449077179437573714;   // 1/(4 - 4^(1/3))
  Base outer, inner; double scale;
  Suzuki(const double *J, double h) : outer(Scaled(J, 1 / share).J, h), inner(Scaled(J, 1 / (1 - 4 * share)).J, h), scale(outer.scale) {}
  template <class T> INLINE void start(Body<T> &s, const Suzuki &k) {
    for (int i = 0; i < 5; ++i) { Base::start(s, i == 2 ? k.inner : k.outer); s.substeps[i] = s; } }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const Suzuki &k) {
    int n = 0;
    _Pragma("GCC unroll 5") for (int i = 0; i < 5; ++i) {
      static_cast<Past<T> &>(s) = s.substeps[i]; n += Base::template step<attitude>(s, i == 2 ? k.inner : k.outer); s.substeps[i] = s; }
    return n; }
};

// ---- Lie-Verlet for the heavy top: half a kick h/2 f, f = Gamma x (weight centre), Gamma the last row of R; Algorithm 1; half a kick -------------

template <class Base> struct LieVerlet {
  Base free; Triple load; double scale;
  LieVerlet(const double *a, double h) : free(a, h), load{0.25 * h * h * a[3], 0.25 * h * h * a[4], 0.25 * h * h * a[5]}, scale(free.scale) {}
  template <class T> INLINE Vec<T> kick(const LieVerlet &k, Vec<T> G) { return {k.load.z * G.y - k.load.y * G.z, k.load.x * G.z - k.load.z * G.x, k.load.y * G.x - k.load.x * G.y}; }
  template <class T> INLINE void start(Body<T> &s, const LieVerlet &k) { Base::start(s, k.free); s.kick = kick(k, s.R.c); }
  template <bool attitude, class T> INLINE int step(Body<T> &s, const LieVerlet &k) {
    s.p = s.p + s.kick;
    int n = Base::template step<attitude>(s, k.free);
    s.kick = kick(k, s.R.c); s.p = s.p + s.kick; return n; }
};

// ---- marching -----------------------------------------------------------------------------------------------------------------------------------
// Momenta p (3, n) and attitudes R (9, n) are stored component by component; a group of lanes stays in registers for all steps.

template <class T> INLINE void load(T &t, const double *p) { memcpy(&t, p, sizeof t); }
template <class T> INLINE void store(double *p, T t) { memcpy(p, &t, sizeof t); }

template <class Method, class T, bool attitude> static __attribute__((noinline)) long
march(double *p, double *R, const double *J, double h, long n, long steps) {
  const Method method(J, h); const int lanes = Traits<T>::lanes; long solves = 0;
  for (long i = 0; i + lanes <= n; i += lanes, p += lanes, R += lanes) {
    Body<T> s;
    load(s.p.x, p); load(s.p.y, p + n); load(s.p.z, p + 2 * n);
    if (attitude) for (int j = 0; j < 9; ++j) load((&s.R.a.x)[j], R + j * n);
    s.p = method.scale * s.p; Method::start(s, method);
    for (long j = 0; j < steps; ++j) solves += Method::template step<attitude>(s, method);
    s.p = (1 / method.scale) * s.p;
    store(p, s.p.x); store(p + n, s.p.y); store(p + 2 * n, s.p.z);
    if (attitude) for (int j = 0; j < 9; ++j) store(R + j * n, (&s.R.a.x)[j]);
  }
  return solves; }   // counted once for a group of lanes

#define FORM(l, T) if (lanes == l) return R ? march<Method, T, true>(p, R, J, h, n, steps) : march<Method, T, false>(p, R, J, h, n, steps);
template <class Method> static long alone(int lanes, double *p, double *R, const double *J, double h, long n, long steps) { FORM(1, double) return -1; }
template <class Method> static long dispatch(int lanes, double *p, double *R, const double *J, double h, long n, long steps) {
  FORM(1, double)
  FORM(3 * width, Lanes<3>)   // the best form; the others only for comparison
#ifdef SWEEP
  FORM(width, Lanes<1>) FORM(2 * width, Lanes<2>) FORM(4 * width, Lanes<4>)
#endif
  return -1; }

extern "C" int simd_width() { return width; }

// Advance n bodies of inertia J (followed by weight times centre of a top) by `steps` steps of length h; returns the number of Newton solves (per group
// of lanes), -1 for an unknown form.
extern "C" long advance(int method, int lanes, double *p, double *R, const double *J, double h, long n, long steps) {
  switch (method) {
    case 0: return dispatch<Rkmk4>(lanes, p, R, J, h, n, steps);
    case 1: return dispatch<Cayley<0>>(lanes, p, R, J, h, n, steps);
    case 2: return dispatch<Exponential<0>>(lanes, p, R, J, h, n, steps);
    case 3: return dispatch<CayleyScalar<0>>(lanes, p, R, J, h, n, steps);
    case 4: return dispatch<HamiltonJacobi>(lanes, p, R, J, h, n, steps);
    case 5: return alone<Suzuki<Cayley<0>>>(lanes, p, R, J, h, n, steps);
    case 6: return alone<Suzuki<Exponential<0>>>(lanes, p, R, J, h, n, steps);
    case 7: return R ? alone<LieVerlet<Cayley<0>>>(lanes, p, R, J, h, n, steps) : -1;
    case 8: return R ? alone<LieVerlet<Exponential<0>>>(lanes, p, R, J, h, n, steps) : -1;
#ifdef SWEEP
    case 9: return dispatch<Cayley<2>>(lanes, p, R, J, h, n, steps);
    case 10: return dispatch<Cayley<3>>(lanes, p, R, J, h, n, steps);
    case 11: return dispatch<Exponential<2>>(lanes, p, R, J, h, n, steps);
    case 12: return dispatch<Exponential<3>>(lanes, p, R, J, h, n, steps);
#endif
  }
  return -1; }
