"""Packings of this package as configurations, to compare the operators of both."""

from faultgouge.analysis import Configuration, Packing
from faultgouge.analysis.arrays import derive_frozen


def snapshot_of(packing: Packing) -> Configuration:
    """The linearised contacts of a packing, without its drag and its upper layer."""
    whole = packing.configuration
    return derive_frozen(whole, drag_rate=0.0, top=whole.top & False, load_error=0.0)
