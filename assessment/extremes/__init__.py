"""Stiff and extreme cases: `packings` and `cases` say what is tried, `run` tries, draws and writes."""
