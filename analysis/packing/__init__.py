"""A packing of disks: positions, contacts, and the contact law.

`packing` has the data type that all parts exchange; `law`, `contacts` and `geometry` are its parts, `arrays` and
`compensated` its numbers.

May import: nothing of the analysis but its errors.
"""
