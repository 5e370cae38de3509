"""Films: magnification in steps of ten, frames, and files that play."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

from faultgouge.analysis import Packing, PackingFileError, RunFile
from faultgouge.figures.film import COLOUR_DIFFERENCE, usual_suffix, write_film
from faultgouge.figures.motion_films import LARGEST_SHOWN, RunMotion, faces_by_way, film_of_ramp, film_of_run


@pytest.fixture(scope="module")
def packing(reference_packing) -> Packing:
    return reference_packing(1.0)


@pytest.fixture(scope="module")
def motion(packing) -> RunMotion:
    """Displacements that grow tenfold with every unit of time, from rest."""
    shape = np.random.default_rng(1).standard_normal((100, 2))
    shape /= np.linalg.norm(shape, axis=1).max()
    time = np.linspace(0, 8, 81)
    size = np.where(time > 0, 1e-9 * 10.0**time, 0.0)
    return RunMotion(packing, time, size[:, None, None] * shape)


def test_magnification_is_a_power_of_ten_that_only_falls(motion):
    factor, most = motion.magnification(), LARGEST_SHOWN * motion.packing.radius.min()
    np.testing.assert_allclose(np.log10(factor), np.round(np.log10(factor)), rtol=0, atol=1e-12)
    assert np.all(np.diff(factor) <= 0)
    shown = factor * np.linalg.norm(motion.displacement, axis=2).max(axis=1) / most
    assert np.all(shown <= 1 + 1e-12)
    assert np.all(shown[1:] > 0.1 - 1e-13)


def test_displacements_of_a_file_are_those_of_the_nearest_image_and_a_part_of_the_run_is_its_times(packing, tmp_path):
    position = np.stack([packing.position, packing.position + np.array([packing.box_length + 1e-3, 0.0])])
    with RunFile.create(tmp_path / "run.h5", packing) as run:
        run.append(packing)
        run.append_trajectory([0.5, 1.0], position)
        motion = RunMotion.read(run)
    np.testing.assert_allclose(motion.displacement[2], np.tile([1e-3, 0.0], (100, 1)), rtol=0, atol=1e-13)
    assert motion.between(0.4, 1.5).time.tolist() == [0.5, 1.0]
    with pytest.raises(PackingFileError, match=r"1 samples from t = 0\.4 to 0\.6, and two are needed"):
        motion.between(0.4, 0.6)


@pytest.mark.long
@pytest.mark.slow
def test_a_gif_holds_every_frame_stays_close_to_it_and_outlives_a_film_that_ends_early(tmp_path, motion):
    """A film is made of a file that is there, and in a minute: half of one is worth less than the one before."""
    film, path = film_of_run(motion, 8, dots=60), tmp_path / "film.gif"
    write_film(film, path, 20)
    for number, seen in ((0, path), (4, path), (7, path)):
        with Image.open(seen) as gif:
            assert (gif.n_frames, gif.size, gif.info["loop"], gif.info["duration"]) == (8, film.size, 0, 50)
            gif.seek(number)
            off = np.abs(np.asarray(gif.convert("RGB")).astype(int) - film.frame(number)).max(axis=2)
            # the palette has 64 colours, and rare ones are farther from theirs than what stays unseen
            assert np.mean(off > COLOUR_DIFFERENCE) < 0.01
    # so that 100 frames take less than 1.5 MB even here, where each disk moves anew in each frame
    assert path.stat().st_size < 8 * 12_000
    before = path.read_bytes()

    def failing(numbers, count):
        yield from numbers[:3]
        raise MemoryError

    with pytest.raises(MemoryError):
        write_film(film, path, 10, failing)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [before]


def test_a_run_and_a_ramp_show_what_moves(motion, packing):
    loads = [replace(packing, position=packing.position + k * 1e-4, fx=0.01 * k) for k in range(4)]
    # of the ramp each equilibrium is shown twice
    for film, same, other in ((film_of_run(motion, 5, dots=40), 0, 4), (film_of_ramp(loads, 8, dots=40), 1, 7)):
        first = film.frame(0)
        assert np.any(film.frame(other) != first)
        np.testing.assert_array_equal(film.frame(same), first)


def test_disks_of_a_drive_are_greener_the_farther_they_have_moved(packing):
    """Half of the disks move; their faces alone change their colours."""
    far = np.zeros_like(packing.position)
    far[: len(far) // 2] = 0.01
    moved = replace(packing, position=packing.position + far)
    before, after = faces_by_way([packing, moved], np.array([np.zeros_like(far), far]))
    bed = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
    np.testing.assert_array_equal(before[bed], np.broadcast_to(before[bed[0]], before[bed].shape))
    greener = (after @ [-1, 1, 0, 0]) > (before @ [-1, 1, 0, 0])
    np.testing.assert_array_equal(greener[bed], bed < len(far) // 2)


@pytest.mark.slow
def test_mp4_plays_and_has_1080_lines_without_dots(tmp_path, motion):
    """The usual film where imageio-ffmpeg is installed; an even number of dots, as its codec asks."""
    width, height = film_of_run(motion, 2, dots=None).size
    assert (1080 <= height < 1100, width % 2, height % 2) == (True, 0, 0)
    assert usual_suffix() == (".mp4" if find_spec("imageio_ffmpeg") else ".gif")
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra `movie` is not installed")
    write_film(film_of_run(motion, 5, dots=60), tmp_path / "run.mp4", 10)
    frames, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "run.mp4"))
    assert (frames, seconds) == (5, pytest.approx(0.5, abs=0.11))  # a frame more or less


def test_the_disk_that_moves_farthest_is_red(motion):
    """At every moment, whatever the magnification: the reddest dots of all frames are alike."""
    film = film_of_run(motion, 4, dots=60)  # a third of a decade falls differently on each frame's power of ten
    film.moving[2].set_visible(False)  # the floor is red, too
    redness = [(film.frame(k)[:, : film.size[0] // 2].astype(int) @ [1, -1, 0]).max() for k in (1, 2, 3)]
    assert max(redness) - min(redness) <= 3  # edges of disks are mixed with what lies below
