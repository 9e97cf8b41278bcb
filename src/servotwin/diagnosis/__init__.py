"""Why a servo buzzes, sags, overshoots, gets warm, trips or does not move: symptoms, and causes taken away alone."""

from servotwin.diagnosis.api import Diagnosis, Finding, Looked, Measured, diagnose
from servotwin.diagnosis.causes import CAUSES
from servotwin.diagnosis.symptoms import SYMPTOMS, Symptom
from servotwin.diagnosis.trials import Cause

__all__ = ["CAUSES", "SYMPTOMS", "Cause", "Diagnosis", "Finding", "Looked", "Measured", "Symptom", "diagnose"]
