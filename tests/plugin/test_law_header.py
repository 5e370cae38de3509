"""The header of the law by itself: an exponent is one struct in one list, and creates no energy on closed paths.

The header is compiled with a power more, the square, as docs/howto_law.md adds one, and gives out the work of paths.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import MindlinLaw

HEADERS = Path(__file__).parents[2] / "pair_mindlin_smooth"

SQUARE = """
  static constexpr double EXPONENT = 2.0;
  static double growth(double overlap) { return overlap; }
  static double force(double kn, double overlap) { return kn * overlap * overlap; }
  static Compensated force(double kn, Compensated overlap) { return kn * (overlap * overlap); }
  static double lost(double share) { return share; }
"""

PROGRAM = """
#include "mindlin_law.h"
#include <cstdio>

using namespace faultgouge;

struct Square {%s};

// what the plugin asks of each power of its list, beside what the path below does
const double ASKED = PowerList<Square>::at(0, [](auto p) { return p.EXPONENT + p.growth(1.0); });

// legs of a path: overlap and increment of the slip, in small steps; prints slip, force and work at their ends
int main()
{
  using P = Square;
  MindlinLaw law;
  law.kn = 2e6, law.kt = 6e5, law.mu = 0.8, law.history = History::COULOMB;
  double overlap = 1e-3, slip = 0.0, work = 0.0, to, increment;
  const int STEPS = 20000;
  while (std::scanf("%%lf %%lf", &to, &increment) == 2) {
    const double change = (to - overlap) / STEPS, step = increment / STEPS;
    for (int k = 0; k < STEPS; k++) {
      double limit = law.slip_limit_ratio<double>() * overlap;
      const double before = law.tangential_force(law.normal_force<P>(overlap), slip, limit);
      overlap += change;
      limit = law.slip_limit_ratio<double>() * overlap;
      slip = advanced_slip(slip, rescaled_increment<P>(slip, step, change, overlap), limit);
      const double after = law.tangential_force(law.normal_force<P>(overlap), slip, limit);
      work -= 0.5 * (before + after) * step;
    }
    const double limit = law.slip_limit_ratio<double>() * overlap;
    const double force = law.tangential_force(law.normal_force<P>(overlap), slip, limit);
    std::printf("%%.17g %%.17g %%.17g\\n", slip, force, work);
  }
}
"""


def compiled(folder, members):
    """The program with some members of the struct, or what the compiler says."""
    (folder / "path.cpp").write_text(PROGRAM % members)
    command = ["c++", "-std=c++17", "-O1", f"-I{HEADERS}", str(folder / "path.cpp"), "-o", str(folder / "path")]
    return subprocess.run(command, capture_output=True, text=True)


CLOSED = [(1e-3, 1.6e-3), (2e-3, 0.0), (2e-3, -1.6e-3), (1e-3, 0.0)]
"""Slipped, pressed, slipped back, and parted: (overlap, increment) of each leg."""


@pytest.mark.slow
def test_another_exponent(tmp_path, monkeypatch):
    """The square, as the header has it: the slips and forces of the Python law, and no energy out of a closed path."""
    done = compiled(tmp_path, SQUARE)
    assert done.returncode == 0, done.stderr
    for start in np.linspace(-1.6e-3, 1.6e-3, 9):
        path = [(1e-3, start), *CLOSED, (1e-3, -start)]
        words = "\n".join(f"{overlap} {increment}" for overlap, increment in path)
        rows = np.array(
            subprocess.run([tmp_path / "path"], input=words, capture_output=True, text=True).stdout.split(), dtype=float
        ).reshape(-1, 3)
        assert len(rows) == len(path)
        assert rows[-1, 2] >= 0
        monkeypatch.setattr("faultgouge.analysis.packing.law.EXPONENTS", (2.0,))
        law, slip, before = MindlinLaw(2e6, 6e5, 0.8, exponent=2.0, coulomb=True), 0.0, 1e-3
        for (overlap, increment), (there, force, _) in zip(path, rows, strict=True):
            slip = float(law.clamped(overlap, law.remembered(slip, before, overlap) + increment))
            before = overlap
            # the trapezoidal rule of each of 20,000 steps: (d overlap/overlap)^2/12 of each, 2e-10 in all
            assert there == pytest.approx(slip, rel=1e-8, abs=1e-15)
            assert force == pytest.approx(float(law.tangential_force(overlap, slip)), rel=1e-8, abs=1e-12)


@pytest.mark.slow
def test_a_member_that_is_missing_does_not_compile(tmp_path):
    member = "lost"
    said = compiled(tmp_path, "".join(line for line in SQUARE.splitlines(keepends=True) if f" {member}" not in line))
    assert said.returncode != 0
    assert member in said.stderr
