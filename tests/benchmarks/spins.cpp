// The opponent of spins: Heisenberg spins on a ring or a cubic lattice with even edges, s' = s x B, B = -(sum of the neighbours), by turns of one sublattice about the field of the other.
//
// Both sublattices lie apart, x, y and z apart, in rows along the last axis: `half` spins and one image on either side.  A ring is one row.  Neighbours are shifts: the row beside, the same place in four other
// rows, and in the own row of the other sublattice this place and the one before or behind it.
//
// Build: g++ -O3 -march=native -fno-math-errno -ffp-contract=off -shared -fPIC

#include <atomic>
#include <cmath>
#include <thread>
#include <vector>

namespace {

// sin(a)/a and (1 - cos a)/a^2 of x = a^2: polynomials for angles up to a half, libm beyond
inline void coefficients(double x, double &s, double &c) {
  if (x < 0.25) {
    s = 1.0 - x / 6 * (1.0 - x / 20 * (1.0 - x / 42 * (1.0 - x / 72 * (1.0 - x / 110 * (1.0 - x / 156)))));
    c = 0.5 - x / 24 * (1.0 - x / 30 * (1.0 - x / 56 * (1.0 - x / 90 * (1.0 - x / 132 * (1.0 - x / 182)))));
  } else {
    double a = std::sqrt(x), h = std::sin(0.5 * a);
    s = std::sin(a) / a; c = 2.0 * h * h / x;
  }
}

// polynomials alone, for angles up to two: loops without branches are made of vector instructions
inline void quick(double x, double &s, double &c) {
  s = 1.0 + x * (-1.0 / 6 + x * (1.0 / 120 + x * (-1.0 / 5040 + x * (1.0 / 362880 + x * (-1.0 / 39916800 + x * (1.0 / 6227020800 + x * (-1.0 / 1307674368000 + x / 355687428096000)))))));
  c = 0.5 + x * (-1.0 / 24 + x * (1.0 / 720 + x * (-1.0 / 40320 + x * (1.0 / 3628800 + x * (-1.0 / 479001600 + x * (1.0 / 87178291200 + x * (-1.0 / 20922789888000 + x / 6402373705728000)))))));
}

struct Spins {
  long edge, half, rows, pitch;
  std::vector<double> at[2][3];

  void load(long n, bool cubic, const double *s) {
    edge = cubic ? n : 1; half = n / 2; rows = edge * edge; pitch = half + 2;
    for (auto &side : at) for (auto &part : side) part.assign(rows * pitch, 0.0);
    each(n, [&](int side, long place, long site) { for (int k = 0; k < 3; ++k) at[side][k][place] = s[3 * site + k]; });
    for (int side = 0; side < 2; ++side) for (long r = 0; r < rows; ++r) images(side, r);
  }
  void store(long n, double *s) { each(n, [&](int side, long place, long site) { for (int k = 0; k < 3; ++k) s[3 * site + k] = at[side][k][place]; }); }
  template <class F> void each(long n, F f) {
    for (long r = 0; r < rows; ++r) for (long j = 0; j < n; ++j) f(int((r / edge + r % edge + j) & 1), r * pitch + 1 + j / 2, r * n + j);
  }
  void images(int side, long r) { for (auto &p : at[side]) { double *q = &p[r * pitch]; q[0] = q[half]; q[half + 1] = q[1]; } }

  template <bool cubic, bool small> void turn(int side, double h) { turn<cubic, small>(side, h, 0, rows); }
  template <bool cubic, bool small> void turn(int side, double h, long first, long last) {
    for (long r = first; r < last; ++r) {
      long i = r / edge, j = r % edge, odd = (i + j + side) & 1;
      long beside[6] = {r, r, ((i + 1) % edge) * edge + j, ((i + edge - 1) % edge) * edge + j, i * edge + (j + 1) % edge, i * edge + (j + edge - 1) % edge};
      const double *f[3][6]; double *s[3];
      for (int k = 0; k < 3; ++k) {
        s[k] = &at[side][k][r * pitch + 1];
        for (int d = 0; d < 6; ++d) f[k][d] = &at[1 - side][k][beside[d] * pitch + 1] + (d == 1 ? (odd ? 1 : -1) : 0);
      }
      row<cubic, small>(s[0], s[1], s[2], f, h);
      images(side, r);
    }
  }
  template <bool cubic, bool small> void row(double *__restrict x, double *__restrict y, double *__restrict z, const double *(&f)[3][6], double h) {
    const double *a0 = f[0][0], *a1 = f[0][1], *a2 = f[0][2], *a3 = f[0][3], *a4 = f[0][4], *a5 = f[0][5];
    const double *b0 = f[1][0], *b1 = f[1][1], *b2 = f[1][2], *b3 = f[1][3], *b4 = f[1][4], *b5 = f[1][5];
    const double *c0 = f[2][0], *c1 = f[2][1], *c2 = f[2][2], *c3 = f[2][3], *c4 = f[2][4], *c5 = f[2][5];
#pragma GCC ivdep
    for (long i = 0; i < half; ++i) {
      double a = a0[i] + a1[i], b = b0[i] + b1[i], c = c0[i] + c1[i];
      if (cubic) { a += a2[i] + a3[i] + (a4[i] + a5[i]); b += b2[i] + b3[i] + (b4[i] + b5[i]); c += c2[i] + c3[i] + (c4[i] + c5[i]); }
      a *= h; b *= h; c *= h;
      double S, C;
      if (small) quick(a * a + b * b + c * c, S, C); else coefficients(a * a + b * b + c * c, S, C);
      double p = x[i], q = y[i], r = z[i], u = b * r - c * q, v = c * p - a * r, w = a * q - b * p;
      x[i] = p + (S * u + C * (b * w - c * v)); y[i] = q + (S * v + C * (c * u - a * w)); z[i] = r + (S * w + C * (a * v - b * u));
    }
  }
};

template <bool cubic> void run(Spins &spins, double h, long steps, const double *shares, long turns) {
  bool small = true;                       // angles up to |B| h: polynomials serve while they are below two
  double most = 0.0;
  for (long k = 0; k <= turns; ++k) most = std::max(most, std::fabs(shares[k]));
  small = (most + std::fabs(shares[turns])) * std::fabs(h) * (cubic ? 6 : 2) < 2.0;
  double left = 0.0;
  for (long step = 0; step < steps; ++step) {
    for (long k = 0; k < turns; ++k) {
      double time = shares[k] * h + (k ? 0.0 : left);
      int side = (k & 1) ? 0 : 1;          // begins and ends with the second
      if (small) spins.turn<cubic, true>(side, time); else spins.turn<cubic, false>(side, time);
    }
    left = shares[turns] * h;
  }
  if (small) spins.turn<cubic, true>(1, left); else spins.turn<cubic, false>(1, left);
}

} // namespace

// s: the spins, site by site; shares: of a step, of the turns of the second and the first sublattice in turn, turns + 1 of them
extern "C" void spins(long n, int cubic, double *s, double h, long steps, const double *shares, long turns) {
  Spins found;
  found.load(n, cubic, s);
  if (cubic) run<true>(found, h, steps, shares, turns); else run<false>(found, h, steps, shares, turns);
  found.store(n, s);
}

// The rows of a cubic lattice divided among threads, which wait for each other behind every turn, spinning: small angles, the last turn of a step and the first of the next one as one.
extern "C" void spins_in_threads(long n, double *s, double h, long steps, const double *shares, long turns, long threads) {
  Spins found;
  found.load(n, true, s);
  alignas(64) std::atomic<long> arrived{0};
  alignas(64) std::atomic<long> met{0};
  auto wait = [&] {
    long before = met.load(std::memory_order_acquire);
    if (arrived.fetch_add(1, std::memory_order_acq_rel) + 1 == threads) { arrived.store(0, std::memory_order_relaxed); met.store(before + 1, std::memory_order_release); }
    else while (met.load(std::memory_order_acquire) == before) {}
  };
  auto work = [&](long which) {
    long first = found.rows * which / threads, last = found.rows * (which + 1) / threads;
    double left = 0.0;
    for (long step = 0; step < steps; ++step) {
      for (long k = 0; k < turns; ++k) { found.turn<true, true>((k & 1) ? 0 : 1, shares[k] * h + (k ? 0.0 : left), first, last); wait(); }
      left = shares[turns] * h;
    }
    found.turn<true, true>(1, left, first, last);
  };
  std::vector<std::thread> others;
  for (long k = 1; k < threads; ++k) others.emplace_back(work, k);
  work(0);
  for (auto &other : others) other.join();
  found.store(n, s);
}

// ------------------------------------------------------------------ bonds
//
// Turns of both ends of a bond about their sum, a' = a x c (a + b), c = -1, for bonds of one colour after the other; colour 2k and 2k + 1 are the even and the odd ones along axis k.  x, y, z apart, sites in their
// order, even edges.  Along the last axis the ends lie side by side, along others in two rows.

namespace {

inline void turn_bond(double *__restrict x, double *__restrict y, double *__restrict z, long a, long b, double h) {
  double u = -h * (x[a] + x[b]), v = -h * (y[a] + y[b]), w = -h * (z[a] + z[b]), s, c;
  quick(u * u + v * v + w * w, s, c);
  for (long k : {a, b}) {  // m + s (m x omega) + c (m x omega) x omega
    double p = y[k] * w - z[k] * v, q = z[k] * u - x[k] * w, r = x[k] * v - y[k] * u;
    x[k] += s * p + c * (q * w - r * v); y[k] += s * q + c * (r * u - p * w); z[k] += s * r + c * (p * v - q * u);
  }
}

}  // namespace

extern "C" void bonds(long n, int cubic, double *given, double h, long steps, const double *shares, const long *colours, long turns) {
  long all = cubic ? n * n * n : n, axes = cubic ? 3 : 1;
  std::vector<double> part[3];
  for (int k = 0; k < 3; ++k) { part[k].resize(all); for (long i = 0; i < all; ++i) part[k][i] = given[3 * i + k]; }
  double *x = part[0].data(), *y = part[1].data(), *z = part[2].data();
  auto turn = [&](long colour, double time) {
    long axis = colour / 2, odd = colour % 2, stride = 1;
    for (long k = axis; k < axes - 1; ++k) stride *= n;
    long outer = all / (n * stride);
    for (long o = 0; o < outer; ++o) for (long j = odd; j < n; j += 2) {
      if (stride == 1 && j == odd) {
        double *X = x + o * n, *Y = y + o * n, *Z = z + o * n;
        long inner = (n - odd) / 2;
#pragma GCC ivdep
        for (long i = 0; i < inner; ++i) turn_bond(X, Y, Z, odd + 2 * i, odd + 2 * i + 1, time);
        if (odd) turn_bond(X, Y, Z, n - 1, 0, time);
        break;
      }
      long a = (o * n + j) * stride, b = (o * n + (j + 1) % n) * stride;
#pragma GCC ivdep
      for (long i = 0; i < stride; ++i) turn_bond(x, y, z, a + i, b + i, time);
    }
  };
  double left = 0.0;
  for (long k = 0; k < steps; ++k) {
    for (long i = 0; i < turns; ++i) turn(colours[i], (i == 0 ? left : 0.0) + shares[i] * h);
    left = shares[turns] * h;
  }
  turn(colours[turns], left);
  for (int k = 0; k < 3; ++k) for (long i = 0; i < all; ++i) given[3 * i + k] = part[k][i];
}

// ------------------------------------------------------------------ what this machine can do
//
// Two colours by a table of neighbours, six for each site, eight sites side by side: `reach` says of every
// eight entries where they lie, the first of them if they follow each other, ~(the first of sixteen
// among which they are), or the least int if they lie apart.  Polynomials alone.

namespace {

typedef double V __attribute__((vector_size(64)));
typedef double U __attribute__((vector_size(64), aligned(8)));
typedef long I __attribute__((vector_size(64)));
typedef int T __attribute__((vector_size(32), aligned(4)));

inline V at(const double *p) { return (V)*(const U *)p; }

void tabled_turn(double *const (&s)[3], long begin, long end, long places, const int *table, const int *reach, double h) {
  for (long i = begin; i < end; i += 8) {
    V f[3] = {};
    for (long d = 0; d < 6; ++d) {
      int where = reach[(d * places + i) / 8];
      I of = __builtin_convertvector(*(const T *)(table + d * places + i), I);
      if (where >= 0) for (int k = 0; k < 3; ++k) f[k] += at(s[k] + where);
      else if (where != -2147483647 - 1) {
        const I among = of - (long)~where;
        for (int k = 0; k < 3; ++k) f[k] += __builtin_shuffle(at(s[k] + ~where), at(s[k] + ~where + 8), among);
      } else for (int k = 0; k < 3; ++k) { V x; for (int l = 0; l < 8; ++l) x[l] = s[k][of[l]]; f[k] += x; }
    }
    V a = f[0] * h, b = f[1] * h, c = f[2] * h, x = a * a + b * b + c * c;
    V S = 1.0 + x * (-1.0 / 6 + x * (1.0 / 120 + x * (-1.0 / 5040 + x * (1.0 / 362880 - x * (1.0 / 39916800)))));
    V C = 0.5 + x * (-1.0 / 24 + x * (1.0 / 720 + x * (-1.0 / 40320 + x * (1.0 / 3628800 - x * (1.0 / 479001600)))));
    V p = at(s[0] + i), q = at(s[1] + i), r = at(s[2] + i), u = b * r - c * q, v = c * p - a * r, w = a * q - b * p;
    *(U *)(s[0] + i) = p + (S * u + C * (b * w - c * v));
    *(U *)(s[1] + i) = q + (S * v + C * (c * u - a * w));
    *(U *)(s[2] + i) = r + (S * w + C * (a * v - b * u));
  }
}

}  // namespace

// given: (sites, 3); order: the site at each of the places, whole sixteens for each colour; ends: of both colours
extern "C" void tabled(double *given, long places, const long *order, const long *ends, const int *table, const int *reach, double h, long steps, const double *shares, long turns) {
  std::vector<double> part[3];
  for (int k = 0; k < 3; ++k) { part[k].resize(places); for (long i = 0; i < places; ++i) part[k][i] = given[3 * order[i] + k]; }
  double *const s[3] = {part[0].data(), part[1].data(), part[2].data()};
  double left = 0.0;
  for (long step = 0; step < steps; ++step) {
    for (long k = 0; k < turns; ++k) {
      long of = (k & 1) ? 0 : 1;
      tabled_turn(s, of ? ends[0] : 0, ends[of], places, table, reach, shares[k] * h + (k ? 0.0 : left));
    }
    left = shares[turns] * h;
  }
  tabled_turn(s, ends[0], ends[1], places, table, reach, left);
  for (long i = places - 1; i >= 0; --i) for (int k = 0; k < 3; ++k) given[3 * order[i] + k] = part[k][i];
}
