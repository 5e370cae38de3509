"""Suffixes of exports, for parametrised tests."""

from importlib.util import find_spec

import pytest

WITHOUT = "GSD needs the extra export: pip install 'faultgouge[export]'"
GSD = pytest.param(".gsd", marks=pytest.mark.skipif(find_spec("gsd") is None, reason=WITHOUT))
