"""Stiff and extreme cases: tried, drawn and written."""

from .compute import CASES, ExtremeCasesError, check, extremes

__all__ = ["CASES", "ExtremeCasesError", "check", "extremes"]
