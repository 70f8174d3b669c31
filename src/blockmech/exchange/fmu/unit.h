/* A unit of FMI around a plan of blockmech: what its interfaces of either version call.

   States are the coordinates of the drivers and their rates, inputs the efforts on them. The
   acceleration solves  drive(q, q', q'') = effort  by steps of the reduced inertia, so friction
   in the joints counts as in blockmech. */
#include "@NAME@.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif
#define K @DRIVERS@
#define VARIABLES @VARIABLES@
#define TIME 0x7fffffffu /* value reference of FMI 3's independent variable */
#define UNUSED(x) (void)(x)
#define STEPS 60 /* to an acceleration: friction makes it a fixed point */
#define GUID "@GUID@"

typedef const char *String;
typedef unsigned int Ref;
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef struct {
    double time, q[K], rate[K], effort[K], start[2 * K];
    double acceleration[K], values[VARIABLES];
    int fresh, word;
} Instance;

static int evaluate(const Instance *m, const double *acceleration, @NAME@_outputs *out)
{
    @NAME@_inputs in;
    memset(&in, 0, sizeof in);
@INPUTS@
    return @NAME@(&@NAME@_defaults, &in, out);
}

/* a (K x K) d = b by elimination with partial pivoting; d takes the place of b. */
static void solved(double a[K][K], double *b)
{
    for (int k = 0; k < K; ++k) {
        int pivot = k;
        for (int i = k + 1; i < K; ++i)
            if (fabs(a[i][k]) > fabs(a[pivot][k])) pivot = i;
        for (int j = 0; j < K; ++j) {
            const double held = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = held;
        }
        const double held = b[k];
        b[k] = b[pivot];
        b[pivot] = held;
        for (int i = k + 1; i < K; ++i) {
            const double factor = a[i][k] / a[k][k];
            for (int j = k; j < K; ++j) a[i][j] -= factor * a[k][j];
            b[i] -= factor * b[k];
        }
    }
    for (int k = K - 1; k >= 0; --k) {
        for (int j = k + 1; j < K; ++j) b[k] -= a[k][j] * b[j];
        b[k] /= a[k][k];
    }
}

static Status update(Instance *m)
{
    @NAME@_outputs out;
    double q2[K] = {0};
    if (m->fresh) return m->word ? ERROR : OK;
    for (int n = 0; n < STEPS; ++n) {
        double inertia[K][K], step[K], most = 0, size = 0;
        m->word = evaluate(m, q2, &out);
        if (m->word) break;
@TERMS@
        solved(inertia, step);
        for (int i = 0; i < K; ++i) {
            q2[i] += step[i];
            if (fabs(step[i]) > most) most = fabs(step[i]);
            if (fabs(q2[i]) > size) size = fabs(q2[i]);
        }
        if (!(most > 1e-14 * (1 + size))) break;
    }
    if (!m->word) m->word = evaluate(m, q2, &out);
    memcpy(m->acceleration, q2, sizeof q2);
    for (int i = 0; i < K; ++i) {
        m->values[i] = m->q[i];
        m->values[K + i] = m->rate[i];
        m->values[2 * K + i] = q2[i];
        m->values[3 * K + i] = m->effort[i];
    }
@OUTPUTS@
    m->fresh = 1;
    return m->word ? ERROR : OK;
}

static void reset(Instance *m)
{
    static const double start[2 * K] = {@START@};
    memset(m, 0, sizeof *m);
    memcpy(m->q, start, K * sizeof(double));
    memcpy(m->rate, start + K, K * sizeof(double));
}

static Instance *instance(String guid)
{
    Instance *m = guid && !strcmp(guid, GUID) ? malloc(sizeof *m) : NULL;
    if (m) reset(m);
    return m;
}

static void set_time(Instance *m, double time)
{
    m->time = time;
    m->fresh = 0;
}

static Status get_reals(Instance *m, const Ref refs[], size_t n, double values[])
{
    const Status done = update(m);
    for (size_t i = 0; i < n; ++i) {
        if (refs[i] == TIME) values[i] = m->time;
        else if (refs[i] >= VARIABLES) return ERROR;
        else values[i] = m->values[refs[i]];
    }
    return done;
}

static Status set_reals(Instance *m, const Ref refs[], size_t n, const double values[])
{
    m->fresh = 0;
    for (size_t i = 0; i < n; ++i) {
        const Ref r = refs[i];
        if (r < K) m->q[r] = values[i];
        else if (r < 2 * K) m->rate[r - K] = values[i];
        else if (r >= 3 * K && r < 4 * K) m->effort[r - 3 * K] = values[i];
        else return ERROR;
    }
    return OK;
}

static Status set_states(Instance *m, const double x[], size_t n)
{
    if (n != 2 * K) return ERROR;
    memcpy(m->q, x, K * sizeof(double));
    memcpy(m->rate, x + K, K * sizeof(double));
    m->fresh = 0;
    return OK;
}

static Status get_states(const Instance *m, double x[], size_t n)
{
    if (n != 2 * K) return ERROR;
    memcpy(x, m->q, K * sizeof(double));
    memcpy(x + K, m->rate, K * sizeof(double));
    return OK;
}

static Status get_slopes(Instance *m, double x[], size_t n)
{
    const Status done = update(m);
    if (n != 2 * K) return ERROR;
    memcpy(x, m->rate, K * sizeof(double));
    memcpy(x + K, m->acceleration, K * sizeof(double));
    return done;
}

/* Runge-Kutta of fourth order in steps of at most @STEP@ s */
static Status step_to(Instance *m, double t, double length)
{
    static const double share[3] = {0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
    const int steps = length > 0 ? (int)ceil(length / @STEP@) : 0;
    for (int n = 0; n < steps; ++n) {
        const double h = length / steps, from = t + n * h;
        double y[2 * K], z[2 * K], f[2 * K], sum[2 * K];
        get_states(m, y, 2 * K);
        memcpy(z, y, sizeof y);
        memcpy(sum, y, sizeof y);
        for (int s = 0; s < 4; ++s) {
            set_states(m, z, 2 * K);
            set_time(m, from + (s ? share[s - 1] * h : 0));
            if (get_slopes(m, f, 2 * K) != OK) return ERROR;
            for (int i = 0; i < 2 * K; ++i) {
                sum[i] += h * weight[s] * f[i];
                if (s < 3) z[i] = y[i] + h * share[s] * f[i];
            }
        }
        set_states(m, sum, 2 * K);
    }
    set_time(m, t + length);
    return update(m);
}

static Status get_snapshot(const void *m, void **state)
{
    if (!*state) *state = malloc(sizeof(Instance));
    if (!*state) return ERROR;
    memcpy(*state, m, sizeof(Instance));
    return OK;
}

/* States of a unit, kept and written out: either version has them, by its own names. */
#define STATES(Get, Set, Free, Size, Write, Read, Byte) \
    API Status Get(void *m, void **state) { return get_snapshot(m, state); } \
    API Status Set(void *m, void *state) \
    { \
        memcpy(m, state, sizeof(Instance)); \
        return OK; \
    } \
    API Status Free(void *m, void **state) \
    { \
        UNUSED(m); \
        free(*state); \
        *state = NULL; \
        return OK; \
    } \
    API Status Size(void *m, void *state, size_t *size) \
    { \
        UNUSED(m); UNUSED(state); \
        *size = sizeof(Instance); \
        return OK; \
    } \
    API Status Write(void *m, void *state, Byte bytes[], size_t size) \
    { \
        UNUSED(m); \
        if (size < sizeof(Instance)) return ERROR; \
        memcpy(bytes, state, sizeof(Instance)); \
        return OK; \
    } \
    API Status Read(void *m, const Byte bytes[], size_t size, void **state) \
    { \
        if (size < sizeof(Instance) || get_snapshot(m, state) != OK) return ERROR; \
        memcpy(*state, bytes, sizeof(Instance)); \
        return OK; \
    }
