"""The cases of the stability study, one module for each kind of difficulty.

`case` defines a case, `packings` makes the packings, and `checks` has criteria that several cases share.
"""
