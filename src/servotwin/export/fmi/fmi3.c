/* FMI 3.0 for co-simulation: what a tool calls, about a component. */
#include <stdlib.h>
#include <string.h>

#include "component.h"
#include "fmi3Functions.h"

#define NO_SUCH_TYPE "a value reference: all variables are Float64"
#define NOT_FOR_THIS "the call: this model has no use for it"

typedef struct {
    component own;
    fmi3InstanceEnvironment tool;
    fmi3LogMessageCallback log;
    fmi3Boolean early;
} instance;

static void tell(void *of, bool failed, const char *text) {
    instance *one = of;
    if (one->log != NULL)
        one->log(one->tool, failed ? fmi3Error : fmi3OK, failed ? "logStatusError" : "logAll", text);
}

static fmi3Status answer(bool well) { return well ? fmi3OK : fmi3Error; }

static fmi3Status refused(fmi3Instance c, const char *text) {
    tell(c, true, text);
    return fmi3Error;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean logs, size_t count, const fmi3String categories[]) {
    (void)c, (void)logs, (void)count, (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logs, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference between[], size_t count,
    fmi3InstanceEnvironment tool, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)logs, (void)events, (void)between, (void)count, (void)update;
    if (token == NULL || strcmp(token, MODEL_TOKEN) != 0) {
        if (log != NULL)
            log(tool, fmi3Error, "logStatusError", "its instantiation token is another one");
        return NULL;
    }
    instance *one = calloc(1, sizeof *one);
    if (one == NULL)
        return NULL;
    one->tool = tool, one->log = log, one->early = early;
    one->own.tell = tell, one->own.of = one;
    component_reset(&one->own);
    return one;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logs, fmi3InstanceEnvironment tool, fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logs;
    if (log != NULL)
        log(tool, fmi3Error, "logStatusError", "it is for co-simulation");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logs, fmi3InstanceEnvironment tool, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)update, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logs, tool, log);
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerates, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stops, fmi3Float64 stop) {
    (void)tolerates, (void)tolerance, (void)stops, (void)stop;
    condition *now = &((instance *)c)->own.now;
    if (now->at != INSTANTIATED || start - start != 0.0)
        return refused(c, "initialization: it begins at a finite time, once until a reset");
    now->at = INITIALIZING;
    now->start = now->time = start;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    instance *one = c;
    if (one->own.now.at != INITIALIZING)
        return refused(c, "initialization: it has not begun");
    if (!component_ready(&one->own))
        return fmi3Error;
    one->own.now.at = STEPPING;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    ((instance *)c)->own.now.at = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
    component_reset(&((instance *)c)->own);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
    size_t room) {
    bool well = room == count;
    for (size_t k = 0; k < count && k < room; k++)
        well &= component_get(&((instance *)c)->own, references[k], &values[k]);
    return answer(well);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
    const fmi3Float64 values[], size_t given) {
    bool well = given == count;
    for (size_t k = 0; k < count && k < given; k++)
        well &= component_set(&((instance *)c)->own, references[k], values[k]);
    return answer(well);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    instance *one = c;
    if (!component_ready(&one->own))
        return fmi3Error;
    if (*state == NULL && (*state = malloc(sizeof(condition))) == NULL)
        return refused(c, "a state: there is no memory for it");
    *(condition *)*state = one->own.now;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    instance *one = c;
    if (state == NULL)
        return refused(c, "a state: there is none");
    one->own.now = *(condition *)state;
    one->own.fresh = true;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)c, (void)state;
    *size = component_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (state == NULL || size < component_size())
        return refused(c, "a state: its bytes need more room");
    component_write(state, bytes);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    condition read;
    if (!component_read(&((instance *)c)->own, &read, bytes, size))
        return fmi3Error;
    if (*state == NULL && (*state = malloc(sizeof read)) == NULL)
        return refused(c, "a state: there is no memory for it");
    *(condition *)*state = read;
    return fmi3OK;
}

/* A step ends early where a tool lets it and a frame begins: what was asked for acts from there on. */
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 at, fmi3Float64 step, fmi3Boolean keeps, fmi3Boolean *events,
    fmi3Boolean *ends, fmi3Boolean *early, fmi3Float64 *reached) {
    (void)keeps;
    instance *one = c;
    *events = *ends = *early = fmi3False;
    *reached = one->own.now.time;
    if (one->own.now.at != STEPPING)
        return refused(c, "a step: initialization is not over, or the end is");
    if (!component_step(&one->own, at, step, one->early, reached))
        return fmi3Error;
    *early = *reached < at + step;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    (void)c;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Float32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int8 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt8 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int16 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt16 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Int64 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3UInt64 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Boolean values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3String values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    size_t valueSizes[], fmi3Binary values[], size_t nValues) {
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Clock values[]) {
    (void)valueReferences, (void)values;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetFloat32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Float32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int8 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetUInt8(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt8 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int16 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetUInt16(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt16 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetUInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt32 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Int64 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3UInt64 values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Boolean values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3String values[], size_t nValues) {
    (void)valueReferences, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const size_t valueSizes[], const fmi3Binary values[], size_t nValues) {
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Clock values[]) {
    (void)valueReferences, (void)values;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
    size_t* nDependencies) {
    (void)valueReference, (void)nDependencies;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
    size_t elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
    fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
    (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents,
    (void)dependencyKinds, (void)nDependencies;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
    fmi3Float64 sensitivity[], size_t nSensitivity) {
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed, (void)sensitivity,
    (void)nSensitivity;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
    fmi3Float64 sensitivity[], size_t nSensitivity) {
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed, (void)sensitivity,
    (void)nSensitivity;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    (void)valueReferences, (void)intervals, (void)qualifiers;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    (void)valueReferences, (void)counters, (void)resolutions, (void)qualifiers;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, fmi3Float64 shifts[]) {
    (void)valueReferences, (void)shifts;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3Float64 intervals[]) {
    (void)valueReferences, (void)intervals;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3Float64 shifts[]) {
    (void)valueReferences, (void)shifts;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean* discreteStatesNeedUpdate,
    fmi3Boolean* terminateSimulation, fmi3Boolean* nominalsOfContinuousStatesChanged,
    fmi3Boolean* valuesOfContinuousStatesChanged, fmi3Boolean* nextEventTimeDefined, fmi3Float64* nextEventTime) {
    (void)discreteStatesNeedUpdate, (void)terminateSimulation, (void)nominalsOfContinuousStatesChanged,
    (void)valuesOfContinuousStatesChanged, (void)nextEventTimeDefined, (void)nextEventTime;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean* enterEventMode, fmi3Boolean* terminateSimulation) {
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    (void)time;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
    size_t nContinuousStates) {
    (void)continuousStates, (void)nContinuousStates;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
    size_t nContinuousStates) {
    (void)derivatives, (void)nContinuousStates;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators) {
    (void)eventIndicators, (void)nEventIndicators;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates) {
    (void)continuousStates, (void)nContinuousStates;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
    size_t nContinuousStates) {
    (void)nominals, (void)nContinuousStates;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t* nEventIndicators) {
    (void)nEventIndicators;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t* nContinuousStates) {
    (void)nContinuousStates;
    return refused(instance, NOT_FOR_THIS);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues) {
    (void)valueReferences, (void)orders, (void)values, (void)nValues;
    return nValueReferences == 0 ? fmi3OK : refused(instance, NO_SUCH_TYPE);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
    fmi3Float64 activationTime) {
    (void)clockReference, (void)activationTime;
    return refused(instance, NOT_FOR_THIS);
}
