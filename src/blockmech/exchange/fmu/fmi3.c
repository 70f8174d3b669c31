/* FMI 3.0, model exchange and co-simulation. */
#include "unit.h"
#include <stdbool.h>
#include <stdint.h>

typedef void *Component;

API String fmi3GetVersion(void) { return "3.0"; }
API Status fmi3SetDebugLogging(Component c, bool on, size_t n, const String x[])
{
    UNUSED(c); UNUSED(on); UNUSED(n); UNUSED(x);
    return OK;
}
API Component fmi3InstantiateModelExchange(String name, String token, String resources,
                                           bool visible, bool logging, void *environment,
                                           void *logger)
{
    UNUSED(name); UNUSED(resources); UNUSED(visible); UNUSED(logging); UNUSED(environment);
    UNUSED(logger);
    return instance(token);
}
API Component fmi3InstantiateCoSimulation(String name, String token, String resources,
                                          bool visible, bool logging, bool events, bool early,
                                          const Ref required[], size_t n, void *environment,
                                          void *logger, void *intermediate)
{
    UNUSED(name); UNUSED(resources); UNUSED(visible); UNUSED(logging); UNUSED(events);
    UNUSED(early); UNUSED(required); UNUSED(n); UNUSED(environment); UNUSED(logger);
    UNUSED(intermediate);
    return instance(token);
}
API Component fmi3InstantiateScheduledExecution(String name, String token, String resources,
                                                bool visible, bool logging, void *environment,
                                                void *logger, void *clock, void *lock,
                                                void *unlock)
{
    UNUSED(name); UNUSED(token); UNUSED(resources); UNUSED(visible); UNUSED(logging);
    UNUSED(environment); UNUSED(logger); UNUSED(clock); UNUSED(lock); UNUSED(unlock);
    return NULL;
}
API void fmi3FreeInstance(Component c) { free(c); }
API Status fmi3EnterInitializationMode(Component c, bool a, double b, double start, bool d,
                                       double e)
{
    UNUSED(a); UNUSED(b); UNUSED(d); UNUSED(e);
    begin(c, start);
    return OK;
}
API Status fmi3ExitInitializationMode(Component c) { return switched(c); }
API Status fmi3EnterEventMode(Component c) { UNUSED(c); return OK; }
API Status fmi3Terminate(Component c) { UNUSED(c); return OK; }
API Status fmi3Reset(Component c)
{
    reset(c);
    return OK;
}

API Status fmi3GetFloat64(Component c, const Ref refs[], size_t n, double values[], size_t k)
{
    return k == n ? get_reals(c, refs, n, values) : ERROR;
}
API Status fmi3SetFloat64(Component c, const Ref refs[], size_t n, const double values[],
                          size_t k)
{
    return k == n ? set_reals(c, refs, n, values) : ERROR;
}
#define NONE(kind, type) \
    API Status fmi3Get##kind(Component c, const Ref r[], size_t n, type x[], size_t k) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n || k ? ERROR : OK; } \
    API Status fmi3Set##kind(Component c, const Ref r[], size_t n, const type x[], size_t k) \
    { UNUSED(c); UNUSED(r); UNUSED(x); return n || k ? ERROR : OK; }
NONE(Float32, float)
NONE(Int8, int8_t)
NONE(UInt8, uint8_t)
NONE(Int16, int16_t)
NONE(UInt16, uint16_t)
NONE(Int32, int32_t)
NONE(UInt32, uint32_t)
NONE(Int64, int64_t)
NONE(UInt64, uint64_t)
NONE(Boolean, bool)
NONE(String, String)
API Status fmi3GetBinary(Component c, const Ref r[], size_t n, size_t sizes[],
                         const uint8_t *x[], size_t k)
{
    UNUSED(c); UNUSED(r); UNUSED(sizes); UNUSED(x);
    return n || k ? ERROR : OK;
}
API Status fmi3SetBinary(Component c, const Ref r[], size_t n, const size_t sizes[],
                         const uint8_t *const x[], size_t k)
{
    UNUSED(c); UNUSED(r); UNUSED(sizes); UNUSED(x);
    return n || k ? ERROR : OK;
}
API Status fmi3GetClock(Component c, const Ref r[], size_t n, bool x[])
{
    UNUSED(c); UNUSED(r); UNUSED(x);
    return n ? ERROR : OK;
}
API Status fmi3SetClock(Component c, const Ref r[], size_t n, const bool x[])
{
    UNUSED(c); UNUSED(r); UNUSED(x);
    return n ? ERROR : OK;
}

STATES(fmi3GetFMUState, fmi3SetFMUState, fmi3FreeFMUState, fmi3SerializedFMUStateSize,
       fmi3SerializeFMUState, fmi3DeserializeFMUState, uint8_t)

/* What the model description says that a unit does not have. */
#define ABSENT(name, ...) \
    API Status fmi3##name(Component c, __VA_ARGS__) { UNUSED(c); return ERROR; }
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
ABSENT(GetNumberOfVariableDependencies, Ref r, size_t *n)
ABSENT(GetVariableDependencies, Ref r, size_t a[], Ref b[], size_t d[], int e[], size_t n)
ABSENT(GetDirectionalDerivative, const Ref a[], size_t n, const Ref b[], size_t k,
       const double x[], size_t i, double y[], size_t j)
ABSENT(GetAdjointDerivative, const Ref a[], size_t n, const Ref b[], size_t k,
       const double x[], size_t i, double y[], size_t j)
ABSENT(GetIntervalDecimal, const Ref r[], size_t n, double x[], int y[])
ABSENT(GetIntervalFraction, const Ref r[], size_t n, uint64_t x[], uint64_t y[], int z[])
ABSENT(GetShiftDecimal, const Ref r[], size_t n, double x[])
ABSENT(GetShiftFraction, const Ref r[], size_t n, uint64_t x[], uint64_t y[])
ABSENT(SetIntervalDecimal, const Ref r[], size_t n, const double x[])
ABSENT(SetIntervalFraction, const Ref r[], size_t n, const uint64_t x[], const uint64_t y[])
ABSENT(SetShiftDecimal, const Ref r[], size_t n, const double x[])
ABSENT(SetShiftFraction, const Ref r[], size_t n, const uint64_t x[], const uint64_t y[])
ABSENT(GetOutputDerivatives, const Ref r[], size_t n, const int32_t o[], double x[], size_t k)
ABSENT(ActivateModelPartition, Ref r, double t)

API Status fmi3EnterConfigurationMode(Component c) { UNUSED(c); return OK; }
API Status fmi3ExitConfigurationMode(Component c) { UNUSED(c); return OK; }
API Status fmi3EvaluateDiscreteStates(Component c) { UNUSED(c); return OK; }
API Status fmi3UpdateDiscreteStates(Component c, bool *again, bool *end, bool *nominals,
                                    bool *values, bool *defined, double *next)
{
    const Status done = switched(c);
    *next = next_instant(c);
    *defined = isfinite(*next);
    *again = *end = *nominals = *values = false;
    return done;
}

/* model exchange */
API Status fmi3EnterContinuousTimeMode(Component c) { UNUSED(c); return OK; }
API Status fmi3CompletedIntegratorStep(Component c, bool a, bool *enter, bool *end)
{
    UNUSED(c); UNUSED(a);
    *enter = *end = false;
    return OK;
}
API Status fmi3SetTime(Component c, double time)
{
    set_time(c, time);
    return OK;
}
API Status fmi3SetContinuousStates(Component c, const double x[], size_t n)
{
    return set_states(c, x, n);
}
API Status fmi3GetContinuousStateDerivatives(Component c, double x[], size_t n)
{
    return get_slopes(c, x, n);
}
API Status fmi3GetContinuousStates(Component c, double x[], size_t n)
{
    return get_states(c, x, n);
}
API Status fmi3GetNominalsOfContinuousStates(Component c, double x[], size_t n)
{
    UNUSED(c);
    for (size_t i = 0; i < n; ++i) x[i] = 1;
    return OK;
}
API Status fmi3GetEventIndicators(Component c, double x[], size_t n)
{
    UNUSED(c); UNUSED(x);
    return n ? ERROR : OK;
}
API Status fmi3GetNumberOfEventIndicators(Component c, size_t *n)
{
    UNUSED(c);
    *n = 0;
    return OK;
}
API Status fmi3GetNumberOfContinuousStates(Component c, size_t *n)
{
    UNUSED(c);
    *n = N;
    return OK;
}

/* co-simulation */
API Status fmi3EnterStepMode(Component c) { UNUSED(c); return OK; }
API Status fmi3DoStep(Component c, double t, double length, bool keep, bool *event, bool *end,
                      bool *early, double *reached)
{
    const Status done = step_to(c, t, length);
    UNUSED(keep);
    *event = *end = *early = false;
    *reached = ((Instance *)c)->time;
    return done;
}
