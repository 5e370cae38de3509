"""Complex modes over the load: their number, their growth rates, and the loss of a contact that stops them."""

from .count_pairs import PairCounts, along_ramp, antisymmetric_norm, count_pairs

__all__ = ["PairCounts", "along_ramp", "antisymmetric_norm", "count_pairs"]
