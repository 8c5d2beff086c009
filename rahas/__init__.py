"""RAHAS: from the video of a hand-cranked structured-light scanner to measured surfaces."""

__version__ = "0.2.0"
