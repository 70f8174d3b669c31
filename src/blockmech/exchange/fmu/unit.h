/* A unit of FMI around a plan of blockmech: what its interfaces of either version call.

   States are the coordinates of the drivers and their rates, then those of signal blocks and of
   friction laws; inputs the efforts on drivers and the blocks that are fed. The acceleration solves
   drive(q, q', q'') = effort, so friction in the joints counts as in blockmech: by Broyden's method,
   first with the reduced inertia for the slopes (Nocedal & Wright, Numerical Optimization, 2006,
   11.1). */
#include "@NAME@.h"
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif
#define K @DRIVERS@
#define ALL @ALL@ /* states of signal blocks and friction laws */
#define X @STATES@ /* those of them that are integrated */
#define S @SWITCHED@ /* those of them that discrete blocks change */
#define B @BLOCKS@ /* discrete blocks */
#define N (2 * K + X)
#define VARIABLES @VARIABLES@
#define TIME 0x7fffffffu /* value reference of FMI 3's independent variable */
#define UNUSED(x) (void)(x)
#define STEPS 60 /* to an acceleration, at most */
#define CLEAR 1e-8 /* of an acceleration: shorter steps are too near to rounding to tell slopes */
#define GUID "@GUID@"

typedef const char *String;
typedef unsigned int Ref;
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef struct {
    double time, q[K], rate[K], effort[K], acceleration[K];
    double x[ALL + 1], slope[X + 1], next[S + 1], due[B + 1], values[VARIABLES];
    int fresh, word;
} Instance;

static int evaluate(const Instance *m, const double *acceleration, @NAME@_outputs *out)
{
    @NAME@_inputs in;
    memset(&in, 0, sizeof in);
@INPUTS@
    UNUSED(m);
    UNUSED(acceleration);
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
    double q2[K] = {0}, step[K] = {0}, slopes[K][K];
    double most = 0, size = 0, square = 0;
    int n = 0, ends;
    if (m->fresh) return m->word ? ERROR : OK;
    do {
        double inertia[K][K], rest[K];
        m->word = evaluate(m, q2, &out);
        if (n == 0) { /* without friction, which may lock the machine where it does not move */
@FRICTIONLESS@
        } else {
            if (m->word) break;
@TERMS@
        }
        if (n == 0) memcpy(slopes, inertia, sizeof slopes);
        if (most > CLEAR * (1 + size))
            for (int i = 0; i < K; ++i)
                for (int j = 0; j < K; ++j) slopes[i][j] -= rest[i] * step[j] / square;
        memcpy(inertia, slopes, sizeof slopes);
        memcpy(step, rest, sizeof rest);
        solved(inertia, step);
        const double last = most;
        most = size = square = 0;
        for (int i = 0; i < K; ++i) {
            q2[i] += step[i];
            square += step[i] * step[i];
            if (fabs(step[i]) > most) most = fabs(step[i]);
            if (fabs(q2[i]) > size) size = fabs(q2[i]);
        }
        /* Steps that are as short as rounding get no shorter. */
        ends = most <= 1e-14 * (1 + size) || (n > 0 && last <= most && most < CLEAR * (1 + size));
    } while (!ends && ++n < STEPS);
    if (!m->word) m->word = n < STEPS ? evaluate(m, q2, &out) : @NOTCONVERGED@;
    memcpy(m->acceleration, q2, sizeof q2);
@OUTPUTS@
    m->fresh = 1;
    return m->word ? ERROR : OK;
}

static const int places[X + 1] = {@PLACES@};
static const int switches[S + 1] = {@SWITCHES@}, of[S + 1] = {@OF@};
static const double periods[B + 1] = {@PERIODS@}, times[B + 1] = {@TIMES@};
static const int reads[B + 1] = {@READS@};

static int at_once(double instant, double t)
{
    const double size = fabs(t) > fabs(instant) ? fabs(t) : fabs(instant);
    return size < INFINITY && fabs(instant - t) <= 4 * DBL_EPSILON * size;
}

/* The first instant of a discrete block at or after a time, or strictly after it. */
static double instant_of(int block, double t, int after)
{
    const double period = periods[block];
    if (period > 0) {
        const double k = rint(t / period);
        return at_once(k * period, t) ? (k + after) * period : ceil(t / period) * period;
    }
    if (at_once(times[block], t)) return after ? INFINITY : times[block];
    return times[block] > t ? times[block] : INFINITY;
}

/* The next instant of any discrete block. */
static double next_instant(const Instance *m)
{
    double first = INFINITY;
    for (int b = 0; b < B; ++b)
        if (m->due[b] < first) first = m->due[b];
    return first;
}

static void begin(Instance *m, double time)
{
    m->time = time;
    m->fresh = 0;
    for (int b = 0; b < B; ++b) m->due[b] = instant_of(b, time, 0);
}

/* Blocks that are due switch at once; those that read nothing, as a step, do before. */
static Status switched(Instance *m)
{
    for (int reading = 0; reading < 2; ++reading) {
        int some = 0, now[B + 1];
        for (int b = 0; b < B; ++b) {
            now[b] = reads[b] == reading && (m->due[b] <= m->time || at_once(m->due[b], m->time));
            some |= now[b];
        }
        if (!some) continue;
        if (update(m) != OK) return ERROR;
        for (int s = 0; s < S; ++s)
            if (now[of[s]]) m->x[switches[s]] = m->next[s];
        for (int b = 0; b < B; ++b)
            if (now[b]) m->due[b] = instant_of(b, m->time, 1);
        m->fresh = 0;
    }
    return update(m);
}

static void reset(Instance *m)
{
    static const double start[2 * K] = {@START@}, initial[ALL + 1] = {@INITIAL@};
    memset(m, 0, sizeof *m);
    memcpy(m->q, start, K * sizeof(double));
    memcpy(m->rate, start + K, K * sizeof(double));
    memcpy(m->x, initial, ALL * sizeof(double));
    begin(m, 0);
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
    for (size_t i = 0; i < n; ++i)
        switch (refs[i]) {
@SETS@
        default: return ERROR;
        }
    return OK;
}

static Status set_states(Instance *m, const double y[], size_t n)
{
    if (n != N) return ERROR;
    memcpy(m->q, y, K * sizeof(double));
    memcpy(m->rate, y + K, K * sizeof(double));
    for (int i = 0; i < X; ++i) m->x[places[i]] = y[2 * K + i];
    m->fresh = 0;
    return OK;
}

static Status get_states(const Instance *m, double y[], size_t n)
{
    if (n != N) return ERROR;
    memcpy(y, m->q, K * sizeof(double));
    memcpy(y + K, m->rate, K * sizeof(double));
    for (int i = 0; i < X; ++i) y[2 * K + i] = m->x[places[i]];
    return OK;
}

static Status get_slopes(Instance *m, double f[], size_t n)
{
    const Status done = update(m);
    if (n != N) return ERROR;
    memcpy(f, m->rate, K * sizeof(double));
    memcpy(f + K, m->acceleration, K * sizeof(double));
    memcpy(f + 2 * K, m->slope, X * sizeof(double));
    return done;
}

/* Runge-Kutta of fourth order in steps of at most @STEP@ s */
static Status smooth_to(Instance *m, double end)
{
    static const double share[3] = {0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
    const double t = m->time, length = end - t;
    const int steps = length > 0 ? (int)ceil(length / @STEP@) : 0;
    for (int n = 0; n < steps; ++n) {
        const double h = length / steps, from = t + n * h;
        double y[N], z[N], f[N], sum[N];
        get_states(m, y, N);
        memcpy(z, y, sizeof y);
        memcpy(sum, y, sizeof y);
        for (int s = 0; s < 4; ++s) {
            set_states(m, z, N);
            set_time(m, from + (s ? share[s - 1] * h : 0));
            if (get_slopes(m, f, N) != OK) return ERROR;
            for (int i = 0; i < N; ++i) {
                sum[i] += h * weight[s] * f[i];
                if (s < 3) z[i] = y[i] + h * share[s] * f[i];
            }
        }
        set_states(m, sum, N);
    }
    set_time(m, end);
    return update(m);
}

/* The same from instant to instant of the discrete blocks. */
static Status step_to(Instance *m, double t, double length)
{
    const double end = t + length;
    set_time(m, t);
    for (;;) {
        const double next = next_instant(m);
        if (next > end && !at_once(next, end)) return smooth_to(m, end);
        if (next > m->time && smooth_to(m, next) != OK) return ERROR;
        if (switched(m) != OK) return ERROR;
    }
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
