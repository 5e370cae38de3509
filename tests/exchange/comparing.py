"""Two packings, compared."""

import numpy as np

from faultgouge.analysis import Contacts, Packing


def same(a: Packing, b: Packing) -> bool:
    """Whether two packings are the same to the bit."""
    for name in Packing.__dataclass_fields__:
        x, y = getattr(a, name), getattr(b, name)
        if isinstance(x, Contacts):
            pairs = [(getattr(x, part), getattr(y, part)) for part in ("i", "j", "slip", "slip_low")]
        else:
            pairs = [(x, y)]
        if any((p is None) != (q is None) or not np.array_equal(p, q) for p, q in pairs):
            return False
    return True
