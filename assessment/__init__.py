"""The product's judgement of itself: its errors against run time, its stiff and extreme cases, what a scene leaves out.

May import: everything below the studies; a study never.
"""
