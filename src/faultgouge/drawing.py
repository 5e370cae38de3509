"""Draw a packing, or the packing of a file."""

from .figures import draw_packing
from .stored_files import takes_file

draw = takes_file(draw_packing)
