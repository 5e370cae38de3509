"""Sweeps: one task for every scene of a product of keys, handed out to workers, resumable, in shards."""
