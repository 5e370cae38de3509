"""A packing of disks: where the disks are, which of them touch, and the contact law that their forces obey.

`packing` has the one data type that everything passes on; `law`, `contacts` and `geometry` are its parts, `arrays`
and `compensated` its numbers.

May import: nothing of the analysis but its errors.
"""
