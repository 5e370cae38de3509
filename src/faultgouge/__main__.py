"""``python -m faultgouge``."""

from .cli import main

main()
