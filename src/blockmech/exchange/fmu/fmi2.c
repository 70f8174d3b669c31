/* FMI 2.0, model exchange and co-simulation. */
#include "unit.h"

typedef void *Component;
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

API String fmi2GetTypesPlatform(void) { return "default"; }
API String fmi2GetVersion(void) { return "2.0"; }
API Status fmi2SetDebugLogging(Component c, int on, size_t n, const String x[])
{
    UNUSED(c); UNUSED(on); UNUSED(n); UNUSED(x);
    return OK;
}
API Status fmi2Reset(Component c)
{
    reset(c);
    return OK;
}
API Component fmi2Instantiate(String name, int type, String guid, String resources,
                              const Callbacks *functions, int visible, int logging)
{
    UNUSED(name); UNUSED(type); UNUSED(resources); UNUSED(functions); UNUSED(visible);
    UNUSED(logging);
    return instance(guid);
}
API void fmi2FreeInstance(Component c) { free(c); }
API Status fmi2SetupExperiment(Component c, int a, double b, double start, int d, double e)
{
    UNUSED(a); UNUSED(b); UNUSED(d); UNUSED(e);
    begin(c, start);
    return OK;
}
API Status fmi2EnterInitializationMode(Component c) { UNUSED(c); return OK; }
API Status fmi2ExitInitializationMode(Component c) { return switched(c); }
API Status fmi2Terminate(Component c) { UNUSED(c); return OK; }

API Status fmi2GetReal(Component c, const Ref refs[], size_t n, double values[])
{
    return get_reals(c, refs, n, values);
}
API Status fmi2SetReal(Component c, const Ref refs[], size_t n, const double values[])
{
    return set_reals(c, refs, n, values);
}
#define NONE(kind, type) \
    API Status fmi2Get##kind(Component c, const Ref r[], size_t n, type x[]) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n ? ERROR : OK; } \
    API Status fmi2Set##kind(Component c, const Ref r[], size_t n, const type x[]) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n ? ERROR : OK; }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, String)

STATES(fmi2GetFMUstate, fmi2SetFMUstate, fmi2FreeFMUstate, fmi2SerializedFMUstateSize,
       fmi2SerializeFMUstate, fmi2DeSerializeFMUstate, char)
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
    const Status done = switched(c);
    memset(info, 0, sizeof *info);
    info->nextEventTime = next_instant(c);
    info->nextEventTimeDefined = isfinite(info->nextEventTime) ? 1 : 0;
    return done;
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
    set_time(c, time);
    return OK;
}
API Status fmi2SetContinuousStates(Component c, const double x[], size_t n)
{
    return set_states(c, x, n);
}
API Status fmi2GetDerivatives(Component c, double x[], size_t n) { return get_slopes(c, x, n); }
API Status fmi2GetEventIndicators(Component c, double x[], size_t n)
{
    UNUSED(c); UNUSED(x);
    return n ? ERROR : OK;
}
API Status fmi2GetContinuousStates(Component c, double x[], size_t n)
{
    return get_states(c, x, n);
}
API Status fmi2GetNominalsOfContinuousStates(Component c, double x[], size_t n)
{
    UNUSED(c);
    for (size_t i = 0; i < n; ++i) x[i] = 1;
    return OK;
}

/* co-simulation */
API Status fmi2DoStep(Component c, double t, double length, int keep)
{
    UNUSED(keep);
    return step_to(c, t, length);
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
