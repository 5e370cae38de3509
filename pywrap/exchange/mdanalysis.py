"""The reader of run.h5 for MDAnalysis where version 1 had it: :mod:`faultgouge.analysis.files.mdanalysis`."""

from ...analysis.files.mdanalysis import *  # noqa: F403  a second door to the same names
