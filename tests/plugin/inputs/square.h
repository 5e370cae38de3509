  static constexpr double EXPONENT = 2.0;
  static double growth(double overlap) { return overlap; }
  static double force(double kn, double overlap) { return kn * overlap * overlap; }
  static Compensated force(double kn, Compensated overlap) { return kn * (overlap * overlap); }
  static double lost(double share) { return share; }
