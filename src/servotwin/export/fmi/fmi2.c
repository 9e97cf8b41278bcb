/* FMI 2.0 for co-simulation: what a tool calls, about a component. */
#include <stdlib.h>
#include <string.h>

#include "component.h"
#include "fmi2Functions.h"

typedef struct {
    component own;
    fmi2CallbackFunctions tool;
    char *name;
} instance;

static void tell(void *of, bool failed, const char *text) {
    instance *one = of;
    if (one->tool.logger != NULL)
        one->tool.logger(one->tool.componentEnvironment, one->name, failed ? fmi2Error : fmi2OK,
                         failed ? "logStatusError" : "logAll", "%s", text);
}

static fmi2Status answer(bool well) { return well ? fmi2OK : fmi2Error; }

static fmi2Status refused(fmi2Component c, const char *text) {
    tell(c, true, text);
    return fmi2Error;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean logs, size_t count, const fmi2String categories[]) {
    (void)c, (void)logs, (void)count, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *tool, fmi2Boolean visible, fmi2Boolean logs) {
    (void)resources, (void)visible, (void)logs;
    if (tool == NULL || name == NULL)
        return NULL;
    if (type != fmi2CoSimulation || token == NULL || strcmp(token, MODEL_TOKEN) != 0) {
        if (tool->logger != NULL)
            tool->logger(tool->componentEnvironment, name, fmi2Error, "logStatusError", "%s",
                         type != fmi2CoSimulation ? "it is for co-simulation" : "its GUID is another one");
        return NULL;
    }
    instance *one = calloc(1, sizeof *one);
    char *own = malloc(strlen(name) + 1);
    if (one == NULL || own == NULL) {
        free(one), free(own);
        return NULL;
    }
    one->name = strcpy(own, name), one->tool = *tool;
    one->own.tell = tell, one->own.of = one;
    component_reset(&one->own);
    return one;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c != NULL)
        free(((instance *)c)->name);
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerates, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stops, fmi2Real stop) {
    (void)tolerates, (void)tolerance, (void)stops, (void)stop;
    condition *now = &((instance *)c)->own.now;
    if (now->at != INSTANTIATED || start - start != 0.0)
        return refused(c, "the experiment: it begins at a finite time, and is set up once");
    now->start = now->time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    condition *now = &((instance *)c)->own.now;
    if (now->at != INSTANTIATED)
        return refused(c, "initialization: it is over, until a reset");
    now->at = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    instance *one = c;
    if (one->own.now.at != INITIALIZING)
        return refused(c, "initialization: it has not begun");
    if (!component_ready(&one->own))
        return fmi2Error;
    one->own.now.at = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ((instance *)c)->own.now.at = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    component_reset(&((instance *)c)->own);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[]) {
    bool well = true;
    for (size_t k = 0; k < count; k++)
        well &= component_get(&((instance *)c)->own, references[k], &values[k]);
    return answer(well);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[]) {
    bool well = true;
    for (size_t k = 0; k < count; k++)
        well &= component_set(&((instance *)c)->own, references[k], values[k]);
    return answer(well);
}

#define NONE(what, Type, way)                                                                                         \
    fmi2Status fmi2##what(fmi2Component c, const fmi2ValueReference references[], size_t count, way Type values[]) {  \
        (void)references, (void)values;                                                                               \
        return count == 0 ? fmi2OK : refused(c, "a value reference: all variables are real numbers");                 \
    }
#define READ
NONE(GetInteger, fmi2Integer, READ)
NONE(GetBoolean, fmi2Boolean, READ)
NONE(GetString, fmi2String, READ)
NONE(SetInteger, fmi2Integer, const)
NONE(SetBoolean, fmi2Boolean, const)
NONE(SetString, fmi2String, const)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    instance *one = c;
    if (!component_ready(&one->own))
        return fmi2Error;
    if (*state == NULL && (*state = malloc(sizeof(condition))) == NULL)
        return refused(c, "a state: there is no memory for it");
    *(condition *)*state = one->own.now;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    instance *one = c;
    if (state == NULL)
        return refused(c, "a state: there is none");
    one->own.now = *(condition *)state;
    one->own.fresh = true;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = component_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (state == NULL || size < component_size())
        return refused(c, "a state: its bytes need more room");
    component_write(state, (uint8_t *)bytes);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    condition read;
    if (!component_read(&((instance *)c)->own, &read, (const uint8_t *)bytes, size))
        return fmi2Error;
    if (*state == NULL && (*state = malloc(sizeof read)) == NULL)
        return refused(c, "a state: there is no memory for it");
    *(condition *)*state = read;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean keeps) {
    (void)keeps;
    instance *one = c;
    double reached;
    if (one->own.now.at != STEPPING)
        return refused(c, "a step: initialization is not over, or the end is");
    return answer(component_step(&one->own, at, step, false, &reached));
}

fmi2Status fmi2CancelStep(fmi2Component c) { return refused(c, "a step: none runs beside"); }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *status) {
    (void)kind, (void)status;
    (void)c;
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((instance *)c)->own.now.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = ((instance *)c)->own.now.at == TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t count,
                                        const fmi2ValueReference knowns[], size_t given, const fmi2Real seed[],
                                        fmi2Real values[]) {
    (void)unknowns, (void)count, (void)knowns, (void)given, (void)seed, (void)values;
    return refused(c, "derivatives: there are none");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    (void)references, (void)orders, (void)values;
    return count == 0 ? fmi2OK : refused(c, "derivatives of inputs: inputs are held over a step");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    (void)references, (void)orders, (void)values;
    return count == 0 ? fmi2OK : refused(c, "derivatives of outputs: there are none");
}
