"""Why a servo buzzes, sags, overshoots, gets warm, trips or does not move: symptoms, and causes taken away alone."""

from servotwin.diagnosis.api import Diagnosis, Finding, Looked, Measured, diagnose
from servotwin.diagnosis.causes import CAUSES, Cause
from servotwin.diagnosis.symptoms import SYMPTOMS, Symptom

__all__ = ["CAUSES", "SYMPTOMS", "Cause", "Diagnosis", "Finding", "Looked", "Measured", "Symptom", "diagnose"]
