"""The yield of a layer: static, dynamic, and under loads that rise at a finite rate."""
