"""Argument of an analysis: a Configuration, or a Packing, which has one and most of its members."""

from typing import TypeAlias

from .configuration import Configuration
from .packing.packing import Packing

HasConfiguration: TypeAlias = Packing | Configuration
