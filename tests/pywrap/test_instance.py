"""A LAMMPS that the plugin does not fit is refused in one sentence, which says what to do."""

import pytest
from reference_layer import SMALL, toml


@pytest.mark.parametrize(
    ("library", "says"),
    [
        (None, "mindlinsmoothplugin.so is not there"),
        (b"of another machine", "was built for another release, MPI or size of atom IDs"),
    ],
    ids=["no plugin", "a plugin that LAMMPS cannot load"],
)
@pytest.mark.slow
def test_a_plugin_that_does_not_fit_is_refused(faultgouge, tmp_path, monkeypatch, library, says):
    if library:
        (tmp_path / "mindlinsmoothplugin.so").write_bytes(library)
    (tmp_path / "scene.toml").write_text(toml(SMALL))
    monkeypatch.setenv("FAULTGOUGE_PLUGIN", str(tmp_path))
    # where the LAMMPS of an earlier test found plugins: its module tells all processes that follow
    monkeypatch.delenv("LAMMPS_PLUGIN_PATH", raising=False)
    done = faultgouge("settle", "scene.toml", "-o", "run.h5", code=1)
    (line,) = (line for line in done.stderr.splitlines() if line.startswith("Error:"))
    for words in (says, str(tmp_path), "build the plugin for this LAMMPS", "FAULTGOUGE_PLUGIN"):
        assert words in line
