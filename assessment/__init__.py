"""Tests of the program itself: errors against run time, stiff and extreme cases, the features that a scene leaves out.

May import: everything below the studies, but no study.
"""
