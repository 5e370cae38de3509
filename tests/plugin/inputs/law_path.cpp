#include "mindlin_law.h"
#include <cstdio>

using namespace faultgouge;

struct Square {
#include "square.h"
};

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
  while (std::scanf("%lf %lf", &to, &increment) == 2) {
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
    std::printf("%.17g %.17g %.17g\n", slip, force, work);
  }
}
