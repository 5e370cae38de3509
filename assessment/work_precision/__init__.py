"""Error against run time: computed by `work_precision`, drawn and written here."""

from .compute import SCENE, STUDIES, ReportError, machine, report, stem

__all__ = ["SCENE", "STUDIES", "ReportError", "machine", "report", "stem"]
