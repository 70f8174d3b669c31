/* FMI 2.0, model exchange and co-simulation, around a plan of blockmech.

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
#define UNUSED(x) (void)(x)
#define STEPS 60 /* to an acceleration: friction makes it a fixed point */
#define GUID "@GUID@"

typedef void *Component;
typedef const char *String;
typedef unsigned int Ref;
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef struct {
    void (*logger)(void *, String, Status, String, String, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;
typedef struct {
    int newDiscreteStatesNeeded, terminateSimulation, nominalsChanged, valuesChanged;
    int nextEventTimeDefined;
    double nextEventTime;
} EventInfo;
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

API String fmi2GetTypesPlatform(void) { return "default"; }
API String fmi2GetVersion(void) { return "2.0"; }
API Status fmi2SetDebugLogging(Component c, int on, size_t n, const String x[])
{
    UNUSED(c); UNUSED(on); UNUSED(n); UNUSED(x);
    return OK;
}
API Status fmi2Reset(Component c)
{
    Instance *m = c;
    static const double start[2 * K] = {@START@};
    memset(m, 0, sizeof *m);
    memcpy(m->q, start, K * sizeof(double));
    memcpy(m->rate, start + K, K * sizeof(double));
    return OK;
}
API Component fmi2Instantiate(String name, int type, String guid, String resources,
                              const Callbacks *functions, int visible, int logging)
{
    Instance *m;
    UNUSED(name); UNUSED(type); UNUSED(resources); UNUSED(functions); UNUSED(visible);
    UNUSED(logging);
    if (!guid || strcmp(guid, GUID)) return NULL;
    m = malloc(sizeof *m);
    if (m) fmi2Reset(m);
    return m;
}
API void fmi2FreeInstance(Component c) { free(c); }
API Status fmi2SetupExperiment(Component c, int a, double b, double start, int d, double e)
{
    UNUSED(a); UNUSED(b); UNUSED(d); UNUSED(e);
    ((Instance *)c)->time = start;
    ((Instance *)c)->fresh = 0;
    return OK;
}
API Status fmi2EnterInitializationMode(Component c) { UNUSED(c); return OK; }
API Status fmi2ExitInitializationMode(Component c) { return update(c); }
API Status fmi2Terminate(Component c) { UNUSED(c); return OK; }

API Status fmi2GetReal(Component c, const Ref refs[], size_t n, double values[])
{
    Instance *m = c;
    const Status done = update(m);
    for (size_t i = 0; i < n; ++i) {
        if (refs[i] >= VARIABLES) return ERROR;
        values[i] = m->values[refs[i]];
    }
    return done;
}
API Status fmi2SetReal(Component c, const Ref refs[], size_t n, const double values[])
{
    Instance *m = c;
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
#define NONE(kind, type) \
    API Status fmi2Get##kind(Component c, const Ref r[], size_t n, type x[]) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n ? ERROR : OK; } \
    API Status fmi2Set##kind(Component c, const Ref r[], size_t n, const type x[]) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n ? ERROR : OK; }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, String)

API Status fmi2GetFMUstate(Component c, void **state)
{
    if (!*state) *state = malloc(sizeof(Instance));
    if (!*state) return ERROR;
    memcpy(*state, c, sizeof(Instance));
    return OK;
}
API Status fmi2SetFMUstate(Component c, void *state)
{
    memcpy(c, state, sizeof(Instance));
    return OK;
}
API Status fmi2FreeFMUstate(Component c, void **state)
{
    UNUSED(c);
    free(*state);
    *state = NULL;
    return OK;
}
API Status fmi2SerializedFMUstateSize(Component c, void *state, size_t *size)
{
    UNUSED(c); UNUSED(state);
    *size = sizeof(Instance);
    return OK;
}
API Status fmi2SerializeFMUstate(Component c, void *state, char bytes[], size_t size)
{
    UNUSED(c);
    if (size < sizeof(Instance)) return ERROR;
    memcpy(bytes, state, sizeof(Instance));
    return OK;
}
API Status fmi2DeSerializeFMUstate(Component c, const char bytes[], size_t size, void **state)
{
    if (size < sizeof(Instance) || fmi2GetFMUstate(c, state) != OK) return ERROR;
    memcpy(*state, bytes, sizeof(Instance));
    return OK;
}
API Status fmi2GetDirectionalDerivative(Component c, const Ref a[], size_t n, const Ref b[],
                                        size_t k, const double x[], double y[])
{
    UNUSED(c); UNUSED(a); UNUSED(n); UNUSED(b); UNUSED(k); UNUSED(x); UNUSED(y);
    return ERROR;
}

/* model exchange */
API Status fmi2EnterEventMode(Component c) { UNUSED(c); return OK; }
API Status fmi2NewDiscreteStates(Component c, EventInfo *info)
{
    UNUSED(c);
    memset(info, 0, sizeof *info);
    return OK;
}
API Status fmi2EnterContinuousTimeMode(Component c) { UNUSED(c); return OK; }
API Status fmi2CompletedIntegratorStep(Component c, int a, int *enter, int *end)
{
    UNUSED(c); UNUSED(a);
    *enter = *end = 0;
    return OK;
}
API Status fmi2SetTime(Component c, double time)
{
    ((Instance *)c)->time = time;
    ((Instance *)c)->fresh = 0;
    return OK;
}
API Status fmi2SetContinuousStates(Component c, const double x[], size_t n)
{
    Instance *m = c;
    if (n != 2 * K) return ERROR;
    memcpy(m->q, x, K * sizeof(double));
    memcpy(m->rate, x + K, K * sizeof(double));
    m->fresh = 0;
    return OK;
}
API Status fmi2GetDerivatives(Component c, double x[], size_t n)
{
    Instance *m = c;
    const Status done = update(m);
    if (n != 2 * K) return ERROR;
    memcpy(x, m->rate, K * sizeof(double));
    memcpy(x + K, m->acceleration, K * sizeof(double));
    return done;
}
API Status fmi2GetEventIndicators(Component c, double x[], size_t n)
{
    UNUSED(c); UNUSED(x);
    return n ? ERROR : OK;
}
API Status fmi2GetContinuousStates(Component c, double x[], size_t n)
{
    Instance *m = c;
    if (n != 2 * K) return ERROR;
    memcpy(x, m->q, K * sizeof(double));
    memcpy(x + K, m->rate, K * sizeof(double));
    return OK;
}
API Status fmi2GetNominalsOfContinuousStates(Component c, double x[], size_t n)
{
    UNUSED(c);
    for (size_t i = 0; i < n; ++i) x[i] = 1;
    return OK;
}

/* co-simulation: Runge-Kutta of fourth order in steps of at most @STEP@ s */
static Status slope(Instance *m, const double *y, double t, double *f)
{
    Status done;
    memcpy(m->q, y, K * sizeof(double));
    memcpy(m->rate, y + K, K * sizeof(double));
    m->time = t;
    m->fresh = 0;
    done = update(m);
    memcpy(f, m->rate, K * sizeof(double));
    memcpy(f + K, m->acceleration, K * sizeof(double));
    return done;
}
API Status fmi2DoStep(Component c, double t, double length, int keep)
{
    static const double share[3] = {0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
    Instance *m = c;
    const int steps = length > 0 ? (int)ceil(length / @STEP@) : 0;
    UNUSED(keep);
    for (int n = 0; n < steps; ++n) {
        const double h = length / steps, from = t + n * h;
        double y[2 * K], z[2 * K], f[2 * K], sum[2 * K];
        memcpy(y, m->q, K * sizeof(double));
        memcpy(y + K, m->rate, K * sizeof(double));
        memcpy(z, y, sizeof y);
        memcpy(sum, y, sizeof y);
        for (int s = 0; s < 4; ++s) {
            if (slope(m, z, from + (s ? share[s - 1] * h : 0), f) != OK) return ERROR;
            for (int i = 0; i < 2 * K; ++i) {
                sum[i] += h * weight[s] * f[i];
                if (s < 3) z[i] = y[i] + h * share[s] * f[i];
            }
        }
        memcpy(m->q, sum, K * sizeof(double));
        memcpy(m->rate, sum + K, K * sizeof(double));
    }
    m->time = t + length;
    m->fresh = 0;
    return update(m);
}
API Status fmi2CancelStep(Component c) { UNUSED(c); return ERROR; }
API Status fmi2SetRealInputDerivatives(Component c, const Ref r[], size_t n, const int o[],
                                       const double x[])
{
    UNUSED(c); UNUSED(r); UNUSED(o); UNUSED(x);
    return n ? ERROR : OK;
}
API Status fmi2GetRealOutputDerivatives(Component c, const Ref r[], size_t n, const int o[],
                                        double x[])
{
    UNUSED(c); UNUSED(r); UNUSED(o); UNUSED(x);
    return n ? ERROR : OK;
}
#define ASKED(kind, type) \
    API Status fmi2Get##kind(Component c, int what, type *x) \
    { UNUSED(c); UNUSED(what); UNUSED(x); return DISCARD; }
ASKED(Status, Status)
ASKED(RealStatus, double)
ASKED(IntegerStatus, int)
ASKED(BooleanStatus, int)
ASKED(StringStatus, String)
