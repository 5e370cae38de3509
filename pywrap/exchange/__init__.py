"""What version 1 had here is in :mod:`faultgouge.analysis.files.formats`. Version 3 will not have this module."""

from ...analysis.files.formats import *  # noqa: F403  a second door to the same names
from ..lammps.restart_file import read_disks as read_disks
