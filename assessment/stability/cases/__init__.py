"""The cases of the stability study, a module for each kind of trouble.

`case` says what a case is, `packings` makes what they run on, `checks` has the criteria that several of them share.
"""
