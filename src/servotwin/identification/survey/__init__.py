"""Statements on a log alone, without a servo and without a fit."""
