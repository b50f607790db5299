/* The same tank as an FMU for co-simulation of FMI 3.0: dx/dt = pump + flow - rate x, exact steps, inputs held. */
#include <math.h>
#include <stdlib.h>
#include "fmi3Functions.h"

enum { RATE, PUMP, FLOW, LEVEL, COUNT };
typedef struct { double value[COUNT]; } Tank;

const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[]) { return fmi3OK; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible, fmi3Boolean logging,
                                         fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference wanted[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Tank *tank = calloc(1, sizeof *tank);
    tank->value[RATE] = 0.4;
    tank->value[LEVEL] = 1.0;
    return tank;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean d, fmi3Float64 t, fmi3Float64 s, fmi3Boolean e, fmi3Float64 end) {
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return fmi3OK; }

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t count) {
    for (size_t k = 0; k < n; k++) value[k] = ((Tank *)c)->value[vr[k]];
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[], size_t count) {
    for (size_t k = 0; k < n; k++) ((Tank *)c)->value[vr[k]] = value[k];
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 step, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *stop,
                      fmi3Boolean *early, fmi3Float64 *last) {
    double *v = ((Tank *)c)->value;
    double drive = (v[PUMP] + v[FLOW]) / v[RATE];
    v[LEVEL] = drive + (v[LEVEL] - drive) * exp(-v[RATE] * step);
    *event = *stop = *early = fmi3False;
    *last = t + step;
    return fmi3OK;
}
