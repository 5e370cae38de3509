"""A LAMMPS that the plugin does not fit is refused in one sentence, which says what to do."""

import pytest

SCENE = "[packing]\ndisks = 30\ntop = 3\nwidth = 6.5\n[law]\nkn = 2e5\n[load]\nfy = 3.0\n"


@pytest.fixture
def refusal(faultgouge, tmp_path, monkeypatch):
    """What the command says with FAULTGOUGE_PLUGIN at some folder."""

    def said(folder):
        monkeypatch.setenv("FAULTGOUGE_PLUGIN", str(folder))
        # where the LAMMPS of an earlier test found plugins: its module tells all processes that follow
        monkeypatch.delenv("LAMMPS_PLUGIN_PATH", raising=False)
        (tmp_path / "scene.toml").write_text(SCENE)
        done = faultgouge("settle", "scene.toml", "-o", "run.h5", code=1)
        (line,) = (line for line in done.stderr.splitlines() if line.startswith("Error:"))
        assert "build the plugin for this LAMMPS" in line
        assert "FAULTGOUGE_PLUGIN" in line
        return line

    return said


@pytest.mark.slow
def test_no_plugin(refusal, tmp_path):
    assert f"{tmp_path}/mindlinsmoothplugin.so is not there" in refusal(tmp_path)


@pytest.mark.slow
def test_a_plugin_that_lammps_cannot_load(refusal, tmp_path):
    (tmp_path / "mindlinsmoothplugin.so").write_bytes(b"of another machine")
    assert "was built for another release, MPI or size of atom IDs" in refusal(tmp_path)
