"""Stiff and extreme cases: tried, drawn and written."""

from .compute import CASES, StabilityError, check, stability

__all__ = ["CASES", "StabilityError", "check", "stability"]
