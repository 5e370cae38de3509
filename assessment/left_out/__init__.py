"""What a scene includes, what it leaves out, why, and what each part costs: the command `explain`.

`switches` runs a scene with and without a part, `costs` compares their times, `explain` puts this into words.

May import: `faultgouge.analysis`, `faultgouge.pywrap`.
"""
