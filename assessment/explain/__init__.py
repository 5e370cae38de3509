"""What a scene includes, what it leaves out, why, and what each part costs: the command `explain`.

`switches` runs a scene with and without a part, `parts` has what is told of one, `explain` puts this into words.

May import: `faultgouge.analysis`, `faultgouge.pywrap`.
"""
