"""Whether the error that an onset states covers the one that it has."""
