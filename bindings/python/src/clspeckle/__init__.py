"""clSpeckle: what a laser-dot depth camera records of a perfect infrared rendering, computed on any OpenCL device.

In one line, NumPy in and NumPy out::

    codes = clspeckle.simulate(ideal, f_number=5.6, seed=7)

or with a camera that keeps the state of the speckle from frame to frame::

    camera = clspeckle.Pipeline.from_parameters(ideal.shape, f_number=5.6, seed=7)
    frame = camera.render(ideal, refresh=moved)

Names, units and equations are those of the C interface: :class:`Pattern`, :class:`Dots`, :class:`MaterialTable`,
:class:`Motion`, :class:`Phase`, :class:`Aperture`, :class:`Lens`, :class:`Sensor`, :class:`Pipeline` with its
:func:`effects`, :class:`Depth`, and the modules :mod:`~clspeckle.philox` and :mod:`~clspeckle.statistics`. Shapes are
(height, width), as NumPy's. Lengths are in metres; ``_dn`` is digital numbers (codes), ``_px`` is image pixels.

All calls release the GIL. Objects may be shared between threads: calls on one object run one after the other. A process
that has used OpenCL must not go on using it in a child of fork(); start workers with "spawn" or "forkserver".
"""

from . import _generated, errors, philox, plot, statistics
from .aperture import Aperture, ApertureInfo
from .capture import Capture, CaptureSequence
from .depth import Depth, DepthResult, DepthSummary
from .diagnosis import (
    Calibration,
    Coverage,
    Diagnosis,
    GapPlace,
    Hypothesis,
    Quantity,
    RankedEffect,
    ScreenedEffect,
    Shrinkage,
    ShrinkStep,
    UsedFrames,
    compare,
    diagnose,
)
from .doe import Beam, DoeDefects, DoeElement, DoePattern, DoePatternInfo
from .doe_design import DoeDesign, SnappedOrders, design_doe, evaluate_doe, snap_directions
from .dot_layout import DotLayout, dot_layout
from .dots import Dots
from .effect import Effect, EffectParameter, effects
from .errors import ClspeckleError
from .lens import Lens
from .material import Material, MaterialTable
from .motion import Motion, MotionInput
from .pattern import Geometry, Pattern
from .phase import FieldGrid, Phase, field_grid
from .pipeline import Frame, Pipeline, PipelineParameters, simulate
from .profile import Profile, ProfileEffect, ProfileMap, ProfileSequence
from .runtime import (
    Buffer,
    Context,
    ContextInfo,
    Device,
    DeviceImage,
    Event,
    Queue,
    Version,
    default_context,
    devices,
    explain_devices,
    version,
    wait,
)
from .sensor import Sensor
from .tuning import Tuning, explain_engine, tune, tuning_record_path

__version__ = _generated.VERSION

__all__ = [
    "Aperture",
    "ApertureInfo",
    "Beam",
    "Buffer",
    "Calibration",
    "Capture",
    "CaptureSequence",
    "ClspeckleError",
    "Context",
    "ContextInfo",
    "Coverage",
    "Depth",
    "DepthResult",
    "DepthSummary",
    "Device",
    "DeviceImage",
    "Diagnosis",
    "DoeDefects",
    "DoeDesign",
    "DoeElement",
    "DoePattern",
    "DoePatternInfo",
    "DotLayout",
    "Dots",
    "Effect",
    "EffectParameter",
    "Event",
    "FieldGrid",
    "Frame",
    "GapPlace",
    "Geometry",
    "Hypothesis",
    "Lens",
    "Material",
    "MaterialTable",
    "Motion",
    "MotionInput",
    "Pattern",
    "Phase",
    "Pipeline",
    "PipelineParameters",
    "Profile",
    "ProfileEffect",
    "ProfileMap",
    "ProfileSequence",
    "Quantity",
    "Queue",
    "RankedEffect",
    "ScreenedEffect",
    "Sensor",
    "ShrinkStep",
    "Shrinkage",
    "SnappedOrders",
    "Tuning",
    "UsedFrames",
    "Version",
    "compare",
    "default_context",
    "design_doe",
    "devices",
    "diagnose",
    "dot_layout",
    "effects",
    "errors",
    "evaluate_doe",
    "explain_devices",
    "explain_engine",
    "field_grid",
    "philox",
    "plot",
    "simulate",
    "snap_directions",
    "statistics",
    "tune",
    "tuning_record_path",
    "version",
    "wait",
]
