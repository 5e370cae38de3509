"""Sweeps: one task for every scene of a product of keys, distributed to workers, resumable, in shards."""
