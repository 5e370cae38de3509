"""Sweeps: one task for every scene of a product of keys, distributed to workers, resumable, in shards."""

from .run_sweep import merge, read_results, run_sweep
from .sweep_plan import Sweep

__all__ = ["Sweep", "merge", "read_results", "run_sweep"]
