// The opponent of pair sums: forces of rigid three-site water and of gravity between all pairs, in four ways.
//
// `plain`: every pair once, one after the other, as one would write it.  `both`: every pair from both of its ends, eight sites side by side, which meet one other at a time; nothing is written but
// the sums of a site.  `once`: every pair once, eight sites side by side with eight others, which go round: each lane meets each of them, and the sums of both go along.  `stored`: every pair once into an
// array, a place for each edge, and then the sums of every site from there.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract=off -shared -fPIC

#include <cmath>
#include <cstring>
#include <vector>

namespace {

typedef double Eight __attribute__((vector_size(64)));
typedef long Mask __attribute__((vector_size(64)));

template <class V> inline V root(V x);
template <> inline double root(double x) { return std::sqrt(x); }
template <> inline Eight root(Eight x) { Eight y; for (int k = 0; k < 8; ++k) y[k] = std::sqrt(x[k]); return y; }
inline Eight load(const double *p) { Eight v; std::memcpy(&v, p, 64); return v; }
inline void store(double *p, Eight v) { std::memcpy(p, &v, 64); }
inline Eight turned(Eight v) { return __builtin_shuffle(v, Mask{1, 2, 3, 4, 5, 6, 7, 0}); }

// 9 numbers of a site, of which pulls are 9; charges product, LJ between the first atoms
struct Water {
  static constexpr int in = 9, out = 9;
  double charge, A6, B12;
  template <class V, class W> inline void pair(const V *a, const W *b, V *f, V *g) const {
    for (int k = 0; k < 9; ++k) f[k] = g[k] = V{};
    for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) {
      V x = a[3 * i] - b[3 * j], y = a[3 * i + 1] - b[3 * j + 1], z = a[3 * i + 2] - b[3 * j + 2];
      V s = x * x + y * y + z * z;
      double q = (i ? 1.0 : -2.0) * (j ? 1.0 : -2.0) * charge;
      V w = q / (s * root(s));
      if (i + j == 0) { V r = 1.0 / s, t = r * r * r; w += r * t * (12.0 * B12 * t - 6.0 * A6); }
      x *= w; y *= w; z *= w;
      f[3 * i] += x; f[3 * i + 1] += y; f[3 * i + 2] += z;
      g[3 * j] -= x; g[3 * j + 1] -= y; g[3 * j + 2] -= z;
    }
  }
};

struct Gravity {  // places and the mass
  static constexpr int in = 4, out = 3;
  template <class V, class W> inline void pair(const V *a, const W *b, V *f, V *g) const {
    V x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    V s = x * x + y * y + z * z, w = 1.0 / (s * root(s)), u = b[3] * w, v = a[3] * w;
    f[0] = u * x; f[1] = u * y; f[2] = u * z;
    g[0] = -(v * x); g[1] = -(v * y); g[2] = -(v * z);
  }
};

template <class T> void plain(const T &term, long n, const double *x, double *f) {
  for (long i = 0; i < n; ++i) for (long j = i + 1; j < n; ++j) {
    double p[9], q[9];
    term.pair(x + T::in * i, x + T::in * j, p, q);
    for (int k = 0; k < T::out; ++k) { f[T::out * i + k] += p[k]; f[T::out * j + k] += q[k]; }
  }
}

template <class T> void stored(const T &term, long n, const double *x, double *f) {
  static std::vector<double> kept;
  long edges = n * (n - 1) / 2, e = 0;
  kept.resize(2 * T::out * edges);
  for (long i = 0; i < n; ++i) for (long j = i + 1; j < n; ++j, ++e) term.pair(x + T::in * i, x + T::in * j, &kept[2 * T::out * e], &kept[2 * T::out * e + T::out]);
  for (long i = 0; i < n; ++i) for (long j = 0; j < n; ++j) if (i != j) {
    long a = i < j ? i : j, b = i < j ? j : i, at = a * n - a * (a + 1) / 2 + b - a - 1;
    for (int k = 0; k < T::out; ++k) f[T::out * i + k] += kept[2 * T::out * at + (i < j ? 0 : T::out) + k];
  }
}

// numbers of all sites in planes: eight of a time; sites behind the last one are far away from all others
template <class T> struct Planes {
  long n, pad; std::vector<double> x, f;
  Planes(long n, const double *given) : n(n), pad((n + 7) / 8 * 8), x(T::in * pad), f(T::out * pad) {
    for (int k = 0; k < T::in; ++k) for (long i = 0; i < pad; ++i) x[k * pad + i] = i < n ? given[T::in * i + k] : (k == 3 && T::in == 4) ? 0.0 : 1e9 * (i - n + 1) + k;
  }
  void take(double *out) const { for (long i = 0; i < n; ++i) for (int k = 0; k < T::out; ++k) out[T::out * i + k] += f[k * pad + i]; }
};

template <class T> void both(const T &term, Planes<T> &P) {
  for (long i = 0; i < P.pad; i += 8) {
    Eight a[9], sum[9] = {}, p[9], q[9], b[9];
    for (int k = 0; k < T::in; ++k) a[k] = load(&P.x[k * P.pad + i]);
    auto range = [&](long from, long to) {
      for (long j = from; j < to; ++j) {
        for (int k = 0; k < T::in; ++k) b[k] = P.x[k * P.pad + j] - Eight{};
        term.pair(a, b, p, q);
        for (int k = 0; k < T::out; ++k) sum[k] += p[k];
      }
    };
    range(0, i);
    for (long j = i; j < i + 8; ++j) {
      Mask other = Mask{0, 1, 2, 3, 4, 5, 6, 7} != j - i;
      for (int k = 0; k < T::in; ++k) b[k] = P.x[k * P.pad + j] - Eight{};
      term.pair(a, b, p, q);
      for (int k = 0; k < T::out; ++k) sum[k] += reinterpret_cast<Eight>(reinterpret_cast<Mask>(p[k]) & other);
    }
    range(i + 8, P.n);
    for (int k = 0; k < T::out; ++k) store(&P.f[k * P.pad + i], sum[k]);
  }
}

template <class T> void once(const T &term, Planes<T> &P) {
  std::fill(P.f.begin(), P.f.end(), 0.0);
  for (long i = 0; i < P.pad; i += 8) {
    Eight a[9], sum[9], p[9], q[9], b[9], back[9];
    for (int k = 0; k < T::in; ++k) a[k] = b[k] = load(&P.x[k * P.pad + i]);
    for (int k = 0; k < T::out; ++k) sum[k] = load(&P.f[k * P.pad + i]);
    for (int r = 1; r < 8; ++r) {  // among themselves from both ends
      for (int k = 0; k < T::in; ++k) b[k] = turned(b[k]);
      term.pair(a, b, p, q);
      for (int k = 0; k < T::out; ++k) sum[k] += p[k];
    }
    for (long j = i + 8; j < P.pad; j += 8) {
      for (int k = 0; k < T::in; ++k) b[k] = load(&P.x[k * P.pad + j]);
      for (int k = 0; k < T::out; ++k) back[k] = load(&P.f[k * P.pad + j]);
      for (int r = 0; r < 8; ++r) {
        term.pair(a, b, p, q);
        for (int k = 0; k < T::out; ++k) { sum[k] += p[k]; back[k] = turned(back[k] + q[k]); }
        for (int k = 0; k < T::in; ++k) b[k] = turned(b[k]);
      }
      for (int k = 0; k < T::out; ++k) store(&P.f[k * P.pad + j], back[k]);
    }
    for (int k = 0; k < T::out; ++k) store(&P.f[k * P.pad + i], sum[k]);
  }
}

template <class T> void run(const T &term, int way, long n, const double *x, double *f, long times) {
  Planes<T> P(n, x);
  for (long t = 0; t < times; ++t) {
    if (way == 0) plain(term, n, x, f);
    if (way == 1) both(term, P);
    if (way == 2) once(term, P);
    if (way == 3) stored(term, n, x, f);
  }
  if (way == 1 || way == 2) P.take(f);
}

// A list of near ones: `others` (degree, n), of which a site has `counts`.
struct List { long degree; const int *others, *counts; };

inline Mask there(const List &list, long i, long d) {
  Mask c;
  for (int l = 0; l < 8; ++l) c[l] = list.counts[i + l];
  return Mask{} + d < c;
}

// Forces of lists, in planes of `pad` sites.  Without `back` every site has all its neighbours.  With it one end of a
// pair has the other, and leaves what that one gets in `slots`, where it is found by `back`, in a fixed order.
void near(const Water &term, long pad, const double *x, double *f, const List &list, const List *back, double *slots) {
  for (long i = 0; i < pad; i += 8) {
    Eight a[9], b[9], sum[9] = {}, p[9], q[9];
    for (int k = 0; k < 9; ++k) a[k] = load(x + k * pad + i);
    for (long d = 0; d < list.degree; ++d) {
      const int *at = list.others + d * pad + i;
      for (int k = 0; k < 9; ++k) for (int l = 0; l < 8; ++l) b[k][l] = x[k * pad + at[l]];
      term.pair(a, b, p, q);
      Mask on = there(list, i, d);
      for (int k = 0; k < 9; ++k) sum[k] += reinterpret_cast<Eight>(reinterpret_cast<Mask>(p[k]) & on);
      if (back) for (int k = 0; k < 9; ++k) store(slots + 9 * (d * pad + i) + 8 * k, q[k]);
    }
    for (int k = 0; k < 9; ++k) store(f + k * pad + i, sum[k]);
  }
  if (back) for (long i = 0; i < pad; i += 8) {
    Eight sum[9], v;
    for (int k = 0; k < 9; ++k) sum[k] = load(f + k * pad + i);
    for (long d = 0; d < back->degree; ++d) {
      const int *at = back->others + d * pad + i;
      Mask on = there(*back, i, d);
      for (int k = 0; k < 9; ++k) {
        for (int l = 0; l < 8; ++l) v[l] = slots[9L * (at[l] & ~7) + 8 * k + (at[l] & 7)];
        sum[k] += reinterpret_cast<Eight>(reinterpret_cast<Mask>(v) & on);
      }
    }
    for (int k = 0; k < 9; ++k) store(f + k * pad + i, sum[k]);
  }
}

} // namespace

// x, f: (9, pad).  Tables are (degree, pad); without `back` (null) the list has both ends of every pair.
extern "C" void lists(long pad, const double *x, double *f, long degree, const int *others, const int *counts, long other_degree,
                      const int *back, const int *back_counts, double *slots, const double *constants, long times) {
  List list{degree, others, counts}, behind{other_degree, back, back_counts};
  for (; times > 0; --times) near(Water{constants[0], constants[1], constants[2]}, pad, x, f, list, back ? &behind : nullptr, slots);
}

// x: (n, 9), atoms of water, or (n, 4), places and masses; f: (n, 9) or (n, 3), to which forces are added.
extern "C" void pairs(int water, int way, long n, const double *x, double *f, long times, const double *constants) {
  if (water) run(Water{constants[0], constants[1], constants[2]}, way, n, x, f, times);
  else run(Gravity{}, way, n, x, f, times);
}
