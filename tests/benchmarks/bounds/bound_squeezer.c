/* Bound for task T4: Andrews' squeezer to 0.03 s, the inertia and effort reduced to its crank, RK4.
   Rates and accelerations of all points are those for a unit rate of the crank that stays.
   gcc -O3 -march=native bound_squeezer.c -o bound_squeezer -lm */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef struct { double x, y, vx, vy, ax, ay; } Point;
typedef struct { double m, I, u, v; } Link; /* mass, inertia about its centre, where that is */
typedef struct { double J, H, Q; } Sums;    /* J q'' + H q'^2 = Q */

static const double START = -0.06171389001427645, END = 0.03, BETA = 15.810771195153707;

static inline Point on(Point base, double ex, double ey, double w, double al, double u, double v) {
    double x = ex * u - ey * v, y = ey * u + ex * v;
    Point p = {base.x + x, base.y + y, base.vx - w * y, base.vy + w * x,
               base.ax - al * y - w * w * x, base.ay + al * x - w * w * y};
    return p;
}

static inline void add(Sums *s, Link l, Point base, double ex, double ey, double w, double al) {
    Point c = on(base, ex, ey, w, al, l.u, l.v);
    s->J += l.m * (c.vx * c.vx + c.vy * c.vy) + l.I * w * w;
    s->H += l.m * (c.vx * c.ax + c.vy * c.ay) + l.I * w * al;
}

/* Links a from B and b from D that meet; side +1: their pin is left of the way from B to D. */
static inline Point dyad(Sums *s, Point B, Point D, double a, double b, double side, Link i, Link j,
                         double *out) {
    double ex = D.x - B.x, ey = D.y - B.y, L2 = ex * ex + ey * ey;
    double u = (a * a - b * b + L2) / (2 * L2), h = side * sqrt(a * a / L2 - u * u);
    double px = u * ex - h * ey, py = u * ey + h * ex, qx = px - ex, qy = py - ey;
    double id = 1 / (px * qy - py * qx), vx = B.vx - D.vx, vy = B.vy - D.vy;
    double w1 = -(vx * qx + vy * qy) * id, w2 = -(vx * px + vy * py) * id;
    double rx = B.ax - D.ax - w1 * w1 * px + w2 * w2 * qx;
    double ry = B.ay - D.ay - w1 * w1 * py + w2 * w2 * qy;
    double a1 = -(rx * qx + ry * qy) * id, a2 = -(rx * px + ry * py) * id;
    add(s, i, B, px / a, py / a, w1, a1);
    add(s, j, D, qx / b, qy / b, w2, a2);
    if (out) out[0] = qx / b, out[1] = qy / b, out[2] = w2, out[3] = a2;
    return on(B, px / a, py / a, w1, a1, a, 0);
}

static inline double acceleration(double q, double rate) {
    static const Link crank = {0.04325, 2.194e-06, 0.00092, 0};
    static const Link i1 = {0.00365, 4.41e-07, 0.0115, 0}, j1 = {0.02373, 5.255e-06, 0.01874, 0.01043};
    static const Link i2 = {0.00706, 5.667e-07, 0.01421, 0}, j2 = {0.0705, 1.169e-05, 0.02308, 0.00916};
    static const Link j3 = {0.05498, 1.912e-05, 0.01228, -0.00449};
    Point O = {0}, D = {-0.03635, 0.03273, 0, 0, 0, 0}, A = {-0.06934, -0.00227, 0, 0, 0, 0};
    Sums s = {0, 0, 0.033};
    double c = cos(q), n = sin(q), l[4];
    add(&s, crank, O, c, n, 1, 0);
    Point B = on(O, c, n, 1, 0, 0.007, 0);
    Point P = dyad(&s, B, D, 0.028, 0.035, 1, i1, j1, l);
    Point E = on(D, l[0], l[1], l[2], l[3], 0.018, 0.02);
    double x = 0.014 - E.x, y = 0.072 - E.y, f = 4530 * (1 - 0.07785 / sqrt(x * x + y * y));
    s.Q += f * (x * E.vx + y * E.vy);
    dyad(&s, P, A, 0.02, 0.04, -1, i2, j2, 0);
    dyad(&s, P, A, 0.02, 0.04, 1, i2, j3, 0);
    return (s.Q - s.H * rate * rate) / s.J;
}

static double moved(long n) {
    double h = END / n, q = START, v = 0;
    for (long i = 0; i < n; i++) {
        double a1 = acceleration(q, v), v2 = v + h / 2 * a1, a2 = acceleration(q + h / 2 * v, v2);
        double v3 = v + h / 2 * a2, a3 = acceleration(q + h / 2 * v2, v3), v4 = v + h * a3;
        double a4 = acceleration(q + h * v3, v4);
        q += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
        v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    return q;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

#define ACCELERATION acceleration
#include "dop853.h"

int main(void) {
    printf("{\"task\":\"T4\",\"dop853\":[");
    for (double tolerance = 1e-2, first = 1; tolerance > 1e-14; tolerance /= 2, first = 0) {
        double least = INFINITY, q = 0;
        for (int r = 0; r < 9; r++) {
            double begin = now();
            q = dop853(START, 0, END, tolerance);
            least = fmin(least, now() - begin);
        }
        printf("%s{\"tolerance\":%g,\"seconds\":%.4g,\"err_theta\":%.3e}", first ? "" : ",",
               tolerance, least, fabs(q - BETA));
    }
    printf("],\"curve\":[");
    for (long n = 60, first = 1; n <= 16000; n = n * 5 / 4, first = 0) {
        double least = INFINITY, q = 0;
        for (int r = 0; r < 9; r++) {
            double begin = now();
            q = moved(n);
            least = fmin(least, now() - begin);
        }
        printf("%s{\"steps\":%ld,\"seconds\":%.4g,\"err_theta\":%.3e}", first ? "" : ",", n, least,
               fabs(q - BETA));
    }
    printf("]}\n");
    return 0;
}
