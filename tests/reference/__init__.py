"""The model of clSpeckle in NumPy float64, written from the equations in the public headers and from their sources,
apart from the kernels: the oracle that the tests compare the library with.

One module per stage, named as in the library, and `theory` for the closed-form speckle statistics (Goodman).
"""

from . import aperture, dots, pattern, phase, philox, pipeline, sensor, statistics, theory

__all__ = ["aperture", "dots", "pattern", "phase", "philox", "pipeline", "sensor", "statistics", "theory"]
