"""A search that is cut off goes on, to the bit, from what it has left in a folder."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_slicing import FEW, on_ranks

from faultgouge.analysis import FaultgougeError
from faultgouge.analysis.errors import OutputError
from faultgouge.analysis.factors.lanczos import Border, SliceError
from faultgouge.analysis.progress import show_progress
from faultgouge.analysis.windows import Ranks, System
from faultgouge.analysis.windows.sliced_search import SlicedSearch
from faultgouge.analysis.windows.slices import Candidate, SliceResult, keep_result, kept_results

PASSING = replace(FEW, largest_basis=0)
"""Slices of 24 modes, in bases that are not kept in memory."""


class CutOffError(Exception):
    """The search ends here, as at a kill."""


def files(folder):
    return sorted(folder.glob("*/*-*.npz"))


def cut_off(search, slices, folder, others=()):
    """Have a search end, as at a kill, when so many slices are kept in a folder; their files."""
    with pytest.raises(CutOffError):
        search([], slices, folder=folder)
    kept = [each for each in files(folder) if each not in others]
    assert len(kept) == slices
    return kept


@pytest.fixture(scope="module")
def search(ramp):
    """The search of the reference packing, from a little before its onset on, for some friction coefficient."""

    def make(mu=1.0):
        path = ramp(mu, 1e-3, 22)

        def search(seen, slices=np.inf, **how):
            """What is said of slices is taken down; the search ends when there are more than so many."""

            def watch(says):
                seen.extend([says] * says.endswith("modes"))
                if len(seen) > slices:
                    raise CutOffError

            with show_progress(watch):
                found = SlicedSearch(lambda fx: System(fx, System.of(path(fx)).stiffness), limits=PASSING, **how)
                return found.first_window(np.array(path.grid[20:]))

        return search

    return make


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, *(pytest.param(n, marks=pytest.mark.long) for n in (2, 3))])
def test_a_search_goes_on_to_the_bit(search, tmp_path, ranks):
    """On any number of ranks, but for what is damaged; then all is known. What was found for other operators stays."""
    all_said, said, nothing = [], [], []
    expected = search()(all_said)
    others = cut_off(search(0.8), 3, tmp_path)
    own = cut_off(search(), 5, tmp_path, others)
    own[0].write_bytes(own[0].read_bytes()[:200])
    own[1].write_bytes(b"PK\x03\x04")
    for each in on_ranks(ranks, lambda mine: search()(said, ranks=mine, folder=tmp_path)):
        assert each.result() == expected
    assert len(said) == len(all_said) - 3
    assert set(others) < set(files(tmp_path))
    assert len(files(tmp_path)) == len(all_said) + 3
    assert search()(nothing, folder=tmp_path) == expected
    assert nothing == []


@pytest.mark.slow
def test_kept_slices_are_compared_with_the_others(search, tmp_path):
    kept = cut_off(search(), 3, tmp_path)
    last = kept_results(kept[0].parent)[-1]
    beyond = last.border.beyond + last.border.spacing
    keep_result(kept[0].parent, last._replace(border=last.border._replace(beyond=beyond)))
    with pytest.raises(SliceError, match=rf"number {last.border.modes[1]} .* one is missing in between"):
        search()([], folder=tmp_path)


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_ends_the_search_at_once(search, tmp_path):
    (tmp_path / "occupied").touch()
    seen = []
    with pytest.raises(OutputError, match="cannot be made a folder"):
        search()(seen, folder=tmp_path / "occupied")
    assert seen == []


@pytest.mark.parametrize(("error", "told"), [(OutputError, 0), (FaultgougeError, 1)])
def test_an_error_that_ends_all_ranks_does_not_wait_for_them(error, told):
    def work():
        raise error("of this rank")

    gathered = []
    with pytest.raises(error, match="of this rank"):
        Ranks(0, 2, lambda mine: gathered.append(mine) or [mine, None]).together(work)
    assert len(gathered) == told


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_no_flipped_bit_goes_unnoticed(tmp_path_factory, data):
    """What is read is what was written (some bytes of a zip file mean nothing), or nothing."""
    folder = tmp_path_factory.mktemp("pass")
    written = SliceResult(Border((3, 9), 1.5, 2.5, 0.1), [Candidate(1, 0.1, 0.2, 3.0 + 1e-3j, -0.5 + 2j)])
    keep_result(folder, written)
    assert kept_results(folder) == [written]
    (path,) = folder.glob("*.npz")
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.sampled_from([1, 16, 128]))
    path.write_bytes(content)
    assert kept_results(folder) in ([], [written])
