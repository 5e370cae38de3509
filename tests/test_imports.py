"""Every module can be imported on its own: a name that has moved is then noticed, whatever else is tested."""

import importlib
import pkgutil

import pytest

import faultgouge

MODULES = [
    module.name
    for module in pkgutil.walk_packages(faultgouge.__path__, "faultgouge.", onerror=lambda name: None)
    if not module.name.endswith("__main__")
]


@pytest.mark.parametrize("name", MODULES)
def test_module_is_imported(name):
    assert importlib.import_module(name).__name__ == name


def test_all_parts_are_there():
    parts = {name.split(".")[1] for name in MODULES}
    assert {"analysis", "commands", "figures", "pywrap", "studies", "cli"} <= parts
