/* A tank as an FMU for co-simulation (FMI 2.0): dx/dt = pump + flow - rate x, exact steps, inputs held. */
#include <math.h>
#include <stdlib.h>
#include "fmi2Functions.h"

enum { RATE, PUMP, FLOW, LEVEL, COUNT };
typedef struct { double value[COUNT]; } Tank;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Tank *tank = calloc(1, sizeof *tank);
    tank->value[RATE] = 0.4;
    tank->value[LEVEL] = 1.0;
    return tank;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real s, fmi2Boolean e, fmi2Real end) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t k = 0; k < n; k++) value[k] = ((Tank *)c)->value[vr[k]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t k = 0; k < n; k++) ((Tank *)c)->value[vr[k]] = value[k];
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real step, fmi2Boolean keep) {
    double *v = ((Tank *)c)->value;
    double drive = (v[PUMP] + v[FLOW]) / v[RATE];
    v[LEVEL] = drive + (v[LEVEL] - drive) * exp(-v[RATE] * step);
    return fmi2OK;
}

#define NOT_THERE(NAME, ...) fmi2Status NAME(__VA_ARGS__) { return fmi2Error; }
NOT_THERE(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
NOT_THERE(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
NOT_THERE(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
NOT_THERE(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
NOT_THERE(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
NOT_THERE(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
NOT_THERE(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *state)
NOT_THERE(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate state)
NOT_THERE(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *state)
NOT_THERE(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate state, size_t *size)
NOT_THERE(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NOT_THERE(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NOT_THERE(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference z[],
          size_t nz, const fmi2Real dv[], fmi2Real dz[])
NOT_THERE(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
          const fmi2Real value[])
NOT_THERE(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
          fmi2Real value[])
NOT_THERE(fmi2CancelStep, fmi2Component c)
NOT_THERE(fmi2GetStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
NOT_THERE(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
NOT_THERE(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
NOT_THERE(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
NOT_THERE(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
