"""Complex modes over the load: their number, their growth rates, and the loss of a contact that stops them."""

from .count_pairs import PairCounts, along_ramp, antisymmetric_norm, count_pairs, load_row
from .table import QUANTITIES, Table, medians_over_load

__all__ = [
    "QUANTITIES",
    "PairCounts",
    "Table",
    "along_ramp",
    "antisymmetric_norm",
    "count_pairs",
    "load_row",
    "medians_over_load",
]
