/* Kepler's problem in a fictive time: the steps of liemech's time transformations, in plain C.

   state: x, y, t, p, q, -H_0 (logarithmic Hamiltonian, adaptive Verlet) or x, y, p, q, t, z (controller).
   -DSTAGES=..., -DKICKS=..., -DDRIFTS=...: the coefficients of a splitting that begins with a drift, kicks[0] = 0. */

#include <math.h>

static const double kicks[STAGES + 1] = {KICKS}, drifts[STAGES] = {DRIFTS};

void advance_logarithmic(double *state, double power, double h, long steps) {
    double x = state[0], y = state[1], t = state[2], p = state[3], q = state[4], rest = state[5];
    (void)power;
    for (long n = 0; n < steps; n++) {
        _Pragma("GCC unroll 32") for (int i = 0; i < STAGES; i++) {
            if (kicks[i] != 0.0) {
                double factor = (kicks[i] * h) / (x * x + y * y);
                p -= factor * x, q -= factor * y;
            }
            double dt = (drifts[i] * h) / (0.5 * (p * p + q * q) + rest);
            x += dt * p, y += dt * q, t += dt;
        }
    }
    state[0] = x, state[1] = y, state[2] = t, state[3] = p, state[4] = q;
}

static inline double scale(double power, double square) { return pow(square, 0.5 * power); }
static inline double slope(double power, double square) { return power * pow(square, 0.5 * power - 1.0); }

void advance_adaptive(double *state, double power, double h, long steps) {
    double x = state[0], y = state[1], t = state[2], p = state[3], q = state[4], rest = state[5], half = 0.5 * h;
    double square = x * x + y * y, r = sqrt(square), pull = 1.0 / (square * r), sigma = scale(power, square), d = slope(power, square);
    for (long n = 0; n < steps; n++) {
        double along = half * sigma * -pull - half * (rest - 1.0 / r) * d;
        double a = p + along * x, b = q + along * y, c = -half * d;
        double linear = c * (x * a + y * b) - 1.0, quadratic = 0.5 * c * c * square, constant = 0.5 * (a * a + b * b);
        double kinetic = 2.0 * constant / (sqrt(linear * linear - 4.0 * quadratic * constant) - linear);
        p = a + kinetic * c * x, q = b + kinetic * c * y;
        double s = sigma + h * sigma * d * (x * p + y * q), miss;
        if (!(s > 0.0)) s = sigma;
        do {
            double u = x + half * (sigma + s) * p, v = y + half * (sigma + s) * q, w = u * u + v * v;
            miss = s - scale(power, w);
            double goal = 0x1p-27 * fabs(s);
            s -= miss / (1.0 - half * slope(power, w) * (u * p + v * q));
            if (fabs(miss) <= goal) break;
        } while (1);
        double dt = half * (sigma + s);
        x += dt * p, y += dt * q, t += dt;
        square = x * x + y * y, r = sqrt(square), pull = 1.0 / (square * r), sigma = scale(power, square), d = slope(power, square);
        along = half * sigma * -pull - half * (kinetic - 1.0 / r + rest) * d;
        p += along * x, q += along * y;
    }
    state[0] = x, state[1] = y, state[2] = t, state[3] = p, state[4] = q;
}

void advance_controlled(double *state, double power, double h, long steps) {
    double x = state[0], y = state[1], p = state[2], q = state[3], t = state[4], z = state[5], half = 0.5 * h;
    double square = x * x + y * y, pull = 1.0 / (square * sqrt(square));
    double rate = -slope(power, square) * (x * p + y * q) / scale(power, square);
    for (long n = 0; n < steps; n++) {
        z += half * rate;
        double dt = h / z;
        p -= 0.5 * dt * pull * x, q -= 0.5 * dt * pull * y;
        x += dt * p, y += dt * q, t += dt;
        square = x * x + y * y, pull = 1.0 / (square * sqrt(square));
        p -= 0.5 * dt * pull * x, q -= 0.5 * dt * pull * y;
        rate = -slope(power, square) * (x * p + y * q) / scale(power, square);
        z += half * rate;
    }
    state[0] = x, state[1] = y, state[2] = p, state[3] = q, state[4] = t, state[5] = z;
}
