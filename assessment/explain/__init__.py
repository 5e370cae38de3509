"""What a scene includes, what it leaves out, why, and, if wanted, what each part costs: the command `explain`.

`switches` runs a scene with and without a part, `cost_comparison` times both, `explanation_table` prints the result.

May import: `faultgouge.analysis`, `faultgouge.pywrap`.
"""
