"""Signals in LAMMPS: against the linear response, and refused where they make no sense."""

import numpy as np
import pytest
from table_rows import rows_of

from faultgouge.analysis.files.signal_files import of_trace, read_signal
from faultgouge.analysis.responses.response import floor_force, impulse_response, layer_force
from faultgouge.analysis.responses.signals import SignalError
from faultgouge.pywrap import Engine, EngineError
from faultgouge.pywrap.runs.undamped import time_step

LEAST = {"packing": {"disks": 30, "width": 6.0}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
BAD_TABLES = {
    "0 1\n1 nan\n": "something else than two numbers, time and value, in line 2",
    "0 1\n2 1\n1 1\n": "not later than the one before in line 3",
    "0 1\n": "fewer than two rows",
}


@pytest.fixture(scope="module")
def packing(climbed):
    """The reference packing at F_x = 0.02, nine tenths of its onset."""
    return climbed(0.02, 2e-3)[-1].packing


@pytest.mark.long
@pytest.mark.parametrize(("on", "scale"), [("layer", 1e-9), ("floor", 1e-10)])
@pytest.mark.slow
def test_record_moves_the_packing_as_linear_response_says(packing, on, scale):
    """The example record of ObsPy, its 30 s in 6 time units, scaled so that the layer moves by 1e-9: in the linear
    regime, and far above the noise of doubles. One percent is asked for; the time step leaves less."""
    obspy = pytest.importorskip("obspy", reason="the extra `seismic` is not installed")
    signal = of_trace(obspy.read()[0]).scale_by(scale, 6.0 / 30)
    assert len(signal) == 3000
    acting = signal if on == "layer" else signal.derivative()
    dt, every, rows = time_step(packing), 20, []
    with Engine(packing) as engine, engine.undamped(dt, signal=acting, on=on) as dynamics:
        for _ in range(int(3.0 / dt / every)):
            rows.append(dynamics.advance(every).velocity[packing.top, 0].mean())
    response = impulse_response(packing, layer_force(packing, 1.0) if on == "layer" else floor_force(packing))
    # the velocity after an impulse, summed over the signal
    fine = 0.5 * dt * np.arange(2 * every * len(rows) + 1)
    kernel = np.real(np.exp(np.multiply.outer(fine, response.rate)) @ response.weight)
    kernel[0] *= 0.5  # trapezia
    predicted = 0.5 * dt * np.convolve(acting.at(fine), kernel)[2 * every : len(fine) : 2 * every]
    assert np.abs(rows).max() > 1e-8  # four decades above the noise
    assert np.abs(np.array(rows) - predicted).max() < 1e-2 * np.abs(rows).max()


@pytest.mark.parametrize("text", BAD_TABLES)
@pytest.mark.slow
def test_lammps_refuses_a_bad_table(reference_packing, tmp_path, text):
    (tmp_path / "bad.txt").write_text(text)
    with Engine(reference_packing(0.0)) as engine, pytest.raises(EngineError, match=BAD_TABLES[text]):
        engine.command(f"fix force top addforce/signal record {tmp_path / 'bad.txt'}")


def test_two_columns_and_records_are_read(tmp_path):
    table, path = tmp_path / "table.csv", tmp_path / "record.mseed"
    table.write_text("# time, value\n0, 1.5\n\n0.5, -2 # a comment\n")
    np.testing.assert_array_equal(read_signal(table).value, [1.5, -2.0])
    obspy = pytest.importorskip("obspy", reason="the extra `seismic` is not installed")
    obspy.read().write(str(path), format="MSEED")
    with pytest.raises(SignalError, match=r"it has the traces BW\.RJOB\.\.EHZ"):
        read_signal(path)
    assert len(read_signal(path, "EHN")) == 3000
    with pytest.raises(SignalError, match="fits none of"):
        read_signal(path, "XYZ")


@pytest.mark.parametrize(("lines", "keys", "says"), rows_of("pywrap/refused_signals.txt"))
def test_scenes_with_a_bad_signal_are_refused(refused_scene, tmp_path, lines, keys, says):
    if lines:
        (tmp_path / "signal.txt").write_text("\n".join(lines))
    perturb = {"fx": 0.0, "time": 1.0, "signal": "signal.txt", **keys}
    assert says in refused_scene({**LEAST, "perturb": perturb}, tmp_path)
