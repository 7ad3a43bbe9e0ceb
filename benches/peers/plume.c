/* The batch kernel's formula in plain C, for comparison: class D, Briggs (1973) rural.
 *   gcc -O3 -march=native -ffast-math plume.c -o plume_c -lm && ./plume_c
 * Prints the best and the median of 60 runs over 1,000,000 points in milliseconds, and a sum. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { POINTS = 1000000, RUNS = 60 };

/* Mass per volume on points (x downwind, y across, z above the axis), in metres, of
 * q_over_2pi_u = Q / (2 pi u). */
static void plume(size_t n, double q_over_2pi_u, const double *restrict x,
                  const double *restrict y, const double *restrict z, double *restrict out) {
    for (size_t i = 0; i < n; i++) {
        double sy = 0.08 * x[i] / sqrt(1.0 + 1e-4 * x[i]);
        double sz = 0.06 * x[i] / sqrt(1.0 + 1.5e-3 * x[i]);
        double a = y[i] / sy, b = z[i] / sz;
        out[i] = x[i] > 0.0 ? q_over_2pi_u / (sy * sz) * exp(-0.5 * (a * a + b * b)) : 0.0;
    }
}

static int by_value(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0) - (d < 0);
}

int main(void) {
    double *x = malloc(POINTS * sizeof *x), *y = malloc(POINTS * sizeof *y);
    double *z = malloc(POINTS * sizeof *z), *out = malloc(POINTS * sizeof *out), ms[RUNS], sum = 0;
    if (!x || !y || !z || !out) return 1;
    for (size_t i = 0; i < POINTS; i++) { /* the same points as the other peers */
        x[i] = 100.0 + 4900.0 * ((i * 7919u) % POINTS) / POINTS;
        y[i] = -600.0 + 1200.0 * ((i * 104729u) % POINTS) / POINTS;
        z[i] = -300.0 + 600.0 * ((i * 15485863ull) % POINTS) / POINTS;
    }
    for (int run = 0; run < RUNS; run++) {
        struct timespec from, to;
        clock_gettime(CLOCK_MONOTONIC, &from);
        plume(POINTS, 8.0, x, y, z, out);
        clock_gettime(CLOCK_MONOTONIC, &to);
        ms[run] = (to.tv_sec - from.tv_sec) * 1e3 + (to.tv_nsec - from.tv_nsec) * 1e-6;
    }
    for (size_t i = 0; i < POINTS; i++) sum += out[i];
    qsort(ms, RUNS, sizeof *ms, by_value);
    printf("%.4f %.4f %.12e\n", ms[0], ms[RUNS / 2], sum);
    return 0;
}
