"""Stiff and extreme cases, one module for each kind of difficulty.

`case` defines a case, `packings` makes the packings, and `checks` has criteria that several cases share.
"""
