"""Remote triggering: computation, figures and text. See `compute` for the physics."""

from .compute import sensitivity
from .forecast import Forecast, forecast

__all__ = ["Forecast", "forecast", "sensitivity"]
