"""The paper's protocol on one packing: computed, drawn and reported."""

from .protocol import reproduce

__all__ = ["reproduce"]
