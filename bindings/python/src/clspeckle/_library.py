"""The shared library: where it is found, the layout of its structs, the signatures of its functions.

Everything here mirrors the C headers name by name. Calls release the GIL (they go through :class:`ctypes.CDLL`).
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from ctypes import (
    POINTER,
    c_char,
    c_char_p,
    c_double,
    c_float,
    c_int32,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any, TypeVar

from . import errors

ABI_VERSION = 0
"""The ABI number of the headers that this file mirrors."""

# --- Constants, by their C names ---

CLSP_SUCCESS = 0

CLSP_FORMAT_NONE = 0
CLSP_FORMAT_UINT8 = 1
CLSP_FORMAT_UINT16 = 2
CLSP_FORMAT_UINT32 = 3
CLSP_FORMAT_FLOAT32 = 4
CLSP_FORMAT_FLOAT32X2 = 5
CLSP_FORMAT_FLOAT32X3 = 6
CLSP_FORMAT_FLOAT32X4 = 7

CLSP_DISK_CACHE_AUTO = 0
CLSP_DISK_CACHE_OFF = 1
CLSP_DISK_CACHE_ON = 2
CLSP_LOG_WARNING = 1
CLSP_LOG_INFO = 2
CLSP_MAX_TUNING_SIZES = 64
CLSP_MAX_TUNING_FRAMES = 10000

CLSP_QUEUE_PROFILING = 1
CLSP_QUEUE_OUT_OF_ORDER = 2

CLSP_DISTRIBUTION_BITS = 0
CLSP_DISTRIBUTION_UNIFORM = 1
CLSP_DISTRIBUTION_NORMAL = 2

CLSP_PROJECTION_TANGENT_PLANE = 0
CLSP_PROJECTION_DIRECTION_COSINES = 1
CLSP_QUANTITY_RADIANT_INTENSITY = 0
CLSP_QUANTITY_PLANE_IRRADIANCE = 1
CLSP_FILTER_BILINEAR = 0
CLSP_FILTER_AREA = 1
CLSP_DEPTH_ALONG_AXIS = 0
CLSP_DEPTH_ALONG_RAY = 1

CLSP_MAX_DOTS = 1000000

CLSP_BEAM_GAUSSIAN = 0
CLSP_BEAM_FLAT_CIRCLE = 1
CLSP_BEAM_FLAT_SQUARE = 2
CLSP_BEAM_SUPER_GAUSSIAN = 3
CLSP_BEAM_SKEWED = 4
CLSP_BEAM_IMAGE = 5
CLSP_DOE_EVALUATION_AUTO = 0
CLSP_DOE_EVALUATION_ORDERS = 1
CLSP_DOE_EVALUATION_APERTURE = 2
CLSP_MAX_DOE_SAMPLES = 8192
CLSP_MAX_DOE_LINES = 16
CLSP_DOE_SOURCE_COMPUTED = 0
CLSP_DOE_SOURCE_MEMORY = 1
CLSP_DOE_SOURCE_DISK = 2

CLSP_FIELD_CIRCULAR_GAUSSIAN = 0
CLSP_FIELD_UNIT_PHASOR = 1
CLSP_DYNAMICS_REPLACE = 0
CLSP_DYNAMICS_CONTINUOUS = 1

CLSP_MAX_MATERIALS = 256

CLSP_MOTION_CORRELATE = 0
CLSP_MOTION_REPLACE = 1

CLSP_PUPIL_CIRCLE = 0
CLSP_PUPIL_IMAGE = 1
CLSP_PUPIL_POLYGON = 2
CLSP_PUPIL_RING = 3
CLSP_NORMALIZATION_TRANSMISSION = 0
CLSP_NORMALIZATION_UNIT_MEAN = 1

CLSP_LENS_RADIUS_CORNER = 0
CLSP_LENS_RADIUS_FOCAL_LENGTH = 1
CLSP_INTERPOLATION_NEAREST = 0
CLSP_INTERPOLATION_LINEAR = 1
CLSP_INTERPOLATION_CUBIC = 2

CLSP_BAYER_RGGB = 1
CLSP_BAYER_BGGR = 2
CLSP_BAYER_GRBG = 3
CLSP_BAYER_GBRG = 4

CLSP_REFRESH_MASK = 0
CLSP_REFRESH_ALL = 1
CLSP_EXPOSURE_CORRELATION_FIELD = 0
CLSP_EXPOSURE_CORRELATION_GAUSSIAN = 1
CLSP_ILLUMINATION_LASER = 0
CLSP_ILLUMINATION_INCOHERENT = 1
CLSP_ILLUMINATION_DARK = 2

CLSP_MAX_EFFECT_PARAMETERS = 4

CLSP_SCENE_DARK = 0
CLSP_SCENE_FLAT = 1
CLSP_SCENE_BOARD = 2
CLSP_SCENE_DOTS = 3
CLSP_MAX_CAPTURE_NAME = 64

CLSP_VERDICT_NONE = 0
CLSP_VERDICT_NAMED = 1
CLSP_VERDICT_AMBIGUOUS = 2
CLSP_VERDICT_UNKNOWN = 3
CLSP_HYPOTHESIS_IRRADIANCE = 0
CLSP_HYPOTHESIS_INTENSITY = 1
CLSP_HYPOTHESIS_CODES = 2
CLSP_MAX_HYPOTHESES = 64

CLSP_DOE_RULE_GS = 0
CLSP_DOE_RULE_GSW = 1
CLSP_DOE_RULE_NOGRETTE = 2
CLSP_DOE_RULE_KIM = 3
CLSP_MAX_DOE_SIDE = 8192
CLSP_MAX_DOE_LEVELS = 256
CLSP_MAX_DOE_ORDERS = 1000000
CLSP_MAX_LAYOUT_DOTS = 100000
CLSP_MAX_DIRECTIONS = 1000000
CLSP_NO_DOT = 0xFFFFFFFF
CLSP_DOT_SATURATED = 1
CLSP_DOT_BORDER = 2
CLSP_DOT_MERGED = 4
CLSP_DOT_FIT_FAILED = 8
CLSP_DOT_FIXED_SHAPE = 16
CLSP_DEPTH_REASON_PLACED = 0
CLSP_DEPTH_REASON_FIT_FAILED = 1
CLSP_DEPTH_REASON_NO_CANDIDATE = 2
CLSP_DEPTH_REASON_UNSUPPORTED = 3
CLSP_DEPTH_REASON_AMBIGUOUS = 4
CLSP_DEPTH_REASON_CONFLICT = 5
CLSP_DEPTH_REASON_OUT_OF_VIEW = 6
CLSP_DEPTH_REASON_NOT_SEEN = 7
CLSP_DEPTH_WARNING_NO_DOTS = 1
CLSP_DEPTH_WARNING_FEW_PLACED = 2
CLSP_DEPTH_WARNING_EPIPOLAR = 4
CLSP_DEPTH_WARNING_SATURATED = 8
CLSP_DEPTH_WARNING_MERGED = 16

# --- Structs, member by member as in the headers ---


PROGRESS_FUNCTION = ctypes.CFUNCTYPE(c_int32, c_void_p, c_char_p, c_double)
LOG_FUNCTION = ctypes.CFUNCTYPE(None, c_void_p, c_uint32, c_char_p)


class ClspErrorInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("status", c_int32),
        ("opencl_code", c_int32),
        ("reserved", c_uint32),
        ("function", c_char_p),
        ("message", c_char_p),
        ("build_log", c_char_p),
    ]


class ClspImage(ctypes.Structure):
    _fields_ = [
        ("mem", c_void_p),
        ("offset_bytes", c_uint64),
        ("pitch_bytes", c_uint64),
        ("width", c_uint32),
        ("height", c_uint32),
        ("format", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspDeviceInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("usable", c_uint32),
        ("type", c_uint64),
        ("global_memory_bytes", c_uint64),
        ("max_allocation_bytes", c_uint64),
        ("local_memory_bytes", c_uint64),
        ("max_work_group_size", c_uint64),
        ("compute_units", c_uint32),
        ("rank", c_uint32),
        ("platform_id", c_void_p),
        ("device_id", c_void_p),
        ("selector", c_char * 16),
        ("name", c_char * 128),
        ("vendor", c_char * 128),
        ("version", c_char * 128),
        ("driver_version", c_char * 128),
        ("platform_name", c_char * 128),
        ("reason", c_char * 256),
    ]


class ClspContextDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("disk_cache", c_uint32),
        ("cl_context_handle", c_void_p),
        ("cl_device", c_void_p),
        ("device", c_char_p),
        ("kernel_dir", c_char_p),
        ("cache_dir", c_char_p),
        ("log", LOG_FUNCTION),
        ("log_data", c_void_p),
    ]


class ClspContextInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("programs_built", c_uint32),
        ("programs_from_cache", c_uint32),
        ("allocation_count", c_uint32),
        ("allocated_bytes", c_uint64),
        ("cl_context_handle", c_void_p),
        ("cl_device", c_void_p),
        ("device_name", c_char * 128),
        ("platform_name", c_char * 128),
    ]


class ClspPhiloxDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("distribution", c_uint32),
        ("seed", c_uint64),
        ("frame_index", c_uint64),
        ("stream", c_uint32),
        ("local_size", c_uint32),
    ]


class ClspPatternDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("projection", c_uint32),
        ("quantity", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("reserved", c_uint32),
        ("texels", POINTER(c_float)),
        ("texels_pitch_bytes", c_uint64),
        ("half_extent_x", c_double),
        ("half_extent_y", c_double),
        ("power_scale", c_double),
        ("laser_from_geometry", c_double * 12),
        ("filter", c_uint32),
        ("filter_taps", c_uint32),
    ]


class ClspGeometry(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("depth_kind", c_uint32),
        ("position", ClspImage),
        ("depth", ClspImage),
        ("normal", ClspImage),
        ("albedo", ClspImage),
        ("visibility", ClspImage),
        ("fx_px", c_double),
        ("fy_px", c_double),
        ("cx_px", c_double),
        ("cy_px", c_double),
    ]


class ClspBeamProfile(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("kind", c_uint32),
        ("covariance_xx_m2", c_double),
        ("covariance_xy_m2", c_double),
        ("covariance_yy_m2", c_double),
        ("width_m", c_double),
        ("height_m", c_double),
        ("order", c_double),
        ("skew_x", c_double),
        ("skew_y", c_double),
        ("m_squared", c_double),
        ("image_width", c_uint32),
        ("image_height", c_uint32),
        ("image", POINTER(c_float)),
        ("image_pitch_bytes", c_uint64),
    ]


class ClspDoeDefects(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("levels", c_uint32),
        ("relative_depth_error", c_double),
        ("rounding_sigma_m", c_double),
        ("etch_noise_rms_m", c_double),
        ("refractive_index", c_double),
        ("dispersion_per_m", c_double),
        ("seed", c_uint64),
        ("feature_samples", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspDoePatternDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("periodic", c_uint32),
        ("phase", POINTER(c_float)),
        ("phase_pitch_bytes", c_uint64),
        ("pixel_pitch_m", c_double),
        ("wavelength_m", c_double),
        ("dot_count", c_uint64),
        ("dot_orders", POINTER(c_int32)),
        ("dot_directions", POINTER(c_double)),
        ("dot_weights", POINTER(c_double)),
        ("beam", POINTER(ClspBeamProfile)),
        ("defects", POINTER(ClspDoeDefects)),
        ("design_levels", c_uint32),
        ("evaluation", c_uint32),
        ("line_count", c_uint32),
        ("oversampling", c_uint32),
        ("line_wavelengths_m", POINTER(c_double)),
        ("line_powers", POINTER(c_double)),
        ("doe_width_m", c_double),
        ("doe_height_m", c_double),
        ("power_w", c_double),
        ("image_width", c_uint32),
        ("image_height", c_uint32),
        ("half_extent_x", c_double),
        ("half_extent_y", c_double),
        ("pixel_envelope", c_uint32),
        ("reserved", c_uint32),
        ("max_memory_bytes", c_uint64),
        ("cache_dir", c_char_p),
        ("progress", PROGRESS_FUNCTION),
        ("progress_data", c_void_p),
    ]


class ClspSpotPatternDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("count", c_uint64),
        ("directions", POINTER(c_double)),
        ("powers", POINTER(c_double)),
        ("beam", POINTER(ClspBeamProfile)),
        ("wavelength_m", c_double),
        ("power_w", c_double),
        ("image_width", c_uint32),
        ("image_height", c_uint32),
        ("half_extent_x", c_double),
        ("half_extent_y", c_double),
    ]


class ClspDoePatternInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("source", c_uint32),
        ("image_width", c_uint32),
        ("image_height", c_uint32),
        ("half_extent_x", c_double),
        ("half_extent_y", c_double),
        ("power_w", c_double),
        ("dots", c_double),
        ("zero_order", c_double),
        ("ghosts", c_double),
        ("scatter", c_double),
        ("inside_image", c_double),
        ("uniformity_rms", c_double),
        ("divergence_x_rad", c_double),
        ("divergence_y_rad", c_double),
        ("m_squared", c_double),
        ("order_spacing_x", c_double),
        ("order_spacing_y", c_double),
        ("dot_count", c_uint64),
        ("device_memory_bytes", c_uint64),
    ]


class ClspDotsDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("principal_point_given", c_uint32),
        ("count", c_uint64),
        ("positions_px", POINTER(c_double)),
        ("sigmas_px", POINTER(c_double)),
        ("peaks", POINTER(c_double)),
        ("sigma_px", c_double),
        ("scale", c_double),
        ("principal_point_x_px", c_double),
        ("principal_point_y_px", c_double),
        ("relative_wavelength_shift", c_double),
        ("beam_skew", c_double),
        ("beam_skew_angle_rad", c_double),
        ("beam_flatness", c_double),
        ("zero_order_relative_intensity", c_double),
        ("ghost_relative_intensity", c_double),
        ("ghost_offset_given", c_uint32),
        ("reserved", c_uint32),
        ("ghost_offset_x_px", c_double),
        ("ghost_offset_y_px", c_double),
        ("scatter_fraction", c_double),
    ]


class ClspDepthDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("max_dots", c_uint32),
        ("projection", c_uint32),
        ("reserved", c_uint32),
        ("direction_count", c_uint64),
        ("directions", POINTER(c_double)),
        ("laser_from_camera", c_double * 12),
        ("fx_px", c_double),
        ("fy_px", c_double),
        ("cx_px", c_double),
        ("cy_px", c_double),
        ("near_m", c_double),
        ("far_m", c_double),
        ("dot_sigma_px", c_double),
        ("min_amplitude_dn", c_double),
        ("threshold_sigmas", c_double),
        ("min_correlation", c_double),
        ("read_noise_dn", c_double),
        ("dn_per_electron", c_double),
        ("black_level_dn", c_double),
        ("saturation_dn", c_double),
        ("epipolar_tolerance_px", c_double),
        ("min_confidence", c_double),
    ]


class ClspDepthDot(ctypes.Structure):
    _fields_ = [
        ("x_px", c_double),
        ("y_px", c_double),
        ("covariance_px2", c_double * 3),
        ("centroid_x_px", c_double),
        ("centroid_y_px", c_double),
        ("amplitude_dn", c_double),
        ("amplitude_sd_dn", c_double),
        ("background_dn", c_double),
        ("shape_px2", c_double * 3),
        ("correlation", c_double),
        ("misfit", c_double),
        ("depth_m", c_double),
        ("depth_sd_m", c_double),
        ("position_m", c_double * 3),
        ("position_sd_m", c_double * 3),
        ("epipolar_error_px", c_double),
        ("epipolar_sd_px", c_double),
        ("confidence", c_double),
        ("flags", c_uint32),
        ("reason", c_uint32),
        ("dot_index", c_uint32),
        ("candidate_count", c_uint32),
        ("iterations", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspDepthPatternDot(ctypes.Structure):
    _fields_ = [("reason", c_uint32), ("detected_index", c_uint32)]


class ClspDepthSummary(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("warnings", c_uint32),
        ("detected_count", c_uint64),
        ("fitted_count", c_uint64),
        ("placed_count", c_uint64),
        ("saturated_count", c_uint64),
        ("merged_count", c_uint64),
        ("pattern_in_view_count", c_uint64),
        ("median_epipolar_error_px", c_double),
        ("expected_epipolar_error_px", c_double),
        ("median_sigma_px", c_double),
        ("median_centre_sd_px", c_double),
    ]


class ClspFieldGrid(ctypes.Structure):
    _fields_ = [
        ("width", c_uint32),
        ("height", c_uint32),
        ("oversampling", c_uint32),
        ("guard_px", c_uint32),
        ("grid_width", c_uint32),
        ("grid_height", c_uint32),
    ]


class ClspPhaseDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("oversampling", c_uint32),
        ("guard_px", c_uint32),
        ("field", c_uint32),
        ("polarization_count", c_uint32),
        ("reserved", c_uint32),
        ("seed", c_uint64),
        ("dynamics", c_uint32),
        ("translate", c_uint32),
    ]


class ClspPhaseAdvance(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("substep", c_uint32),
        ("uniform_path", c_double),
        ("uniform_correlation", c_double),
        ("path", ClspImage),
        ("correlation", ClspImage),
        ("shift", ClspImage),
        ("mask", ClspImage),
    ]


class ClspMaterial(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("roughness_rms_m", c_double),
        ("degree_of_polarization", c_double),
        ("correlation_time_s", c_double),
        ("lateral_correlation_length_m", c_double),
        ("axial_correlation_length_m", c_double),
        ("rotation_correlation_angle_rad", c_double),
        ("subsurface_fraction", c_double),
    ]


class ClspMotionDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("rule", c_uint32),
        ("translate", c_uint32),
        ("depth_kind", c_uint32),
        ("materials", c_void_p),
        ("fx_px", c_double),
        ("fy_px", c_double),
        ("cx_px", c_double),
        ("cy_px", c_double),
        ("replace_threshold", c_double),
        ("occlusion_tolerance", c_double),
    ]


class ClspMotionInput(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("transform_count", c_uint32),
        ("previous_from_current", POINTER(c_double)),
        ("frame_time_s", c_double),
        ("roll_from_motion", c_uint32),
        ("reserved", c_uint32),
        ("position", ClspImage),
        ("depth", ClspImage),
        ("normal", ClspImage),
        ("material", ClspImage),
        ("motion", ClspImage),
        ("previous_position", ClspImage),
        ("previous_depth", ClspImage),
        ("previous_normal", ClspImage),
        ("previous_material", ClspImage),
    ]


class ClspMotionOutput(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("path", ClspImage),
        ("correlation", ClspImage),
        ("shift", ClspImage),
        ("displacement", ClspImage),
        ("mask", ClspImage),
    ]


class ClspApertureDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("oversampling", c_uint32),
        ("guard_px", c_uint32),
        ("pupil", c_uint32),
        ("normalization", c_uint32),
        ("workspace_from_host", c_uint32),
        ("relative_diameter", c_double),
        ("f_number", c_double),
        ("pixel_pitch_m", c_double),
        ("wavelength_m", c_double),
        ("soft_rim", c_double),
        ("degree_of_polarization", c_double),
        ("pupil_image", POINTER(c_float)),
        ("pupil_width", c_uint32),
        ("pupil_height", c_uint32),
        ("pupil_pitch_bytes", c_uint64),
        ("blade_count", c_uint32),
        ("reserved_blades", c_uint32),
        ("blade_rotation_rad", c_double),
        ("blade_curvature", c_double),
        ("obstruction_ratio", c_double),
        ("defocus_waves", c_double),
        ("zernike_waves", c_double * 12),
        ("fill_factor", c_double),
    ]


class ClspApertureInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("grid_width", c_uint32),
        ("grid_height", c_uint32),
        ("pupil_samples", c_uint32),
        ("relative_diameter", c_double),
        ("mean_transmission", c_double),
        ("workspace_bytes", c_uint64),
        ("fft_backend", c_char * 32),
        ("fft_reason", c_char * 192),
        ("fft_engine", c_char * 32),
        ("column_lines", c_uint32),
        ("column_work_items", c_uint32),
        ("row_lines", c_uint32),
        ("row_work_items", c_uint32),
        ("fft_source", c_char * 256),
    ]


class ClspLensDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("radius_unit", c_uint32),
        ("cos4_falloff", c_uint32),
        ("principal_point_given", c_uint32),
        ("principal_point_x_px", c_double),
        ("principal_point_y_px", c_double),
        ("focal_length_x_px", c_double),
        ("focal_length_y_px", c_double),
        ("k1", c_double),
        ("k2", c_double),
        ("k3", c_double),
        ("p1", c_double),
        ("p2", c_double),
        ("vignetting_corner_loss", c_double),
        ("glare_fraction", c_double),
        ("glare_scale_px", c_double),
        ("ambient", c_double),
    ]


class ClspSensorDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("bits", c_uint32),
        ("seed", c_uint64),
        ("exposure_gain_dn", c_double),
        ("saturation_dn", c_double),
        ("black_level_dn", c_double),
        ("read_noise_dn", c_double),
        ("hot_pixel_fraction", c_double),
        ("hot_pixel_mean_dn", c_double),
        ("cold_pixel_fraction", c_double),
        ("float_full_scale", c_double),
        ("dark_frame_dn", POINTER(c_float)),
        ("dark_frame_pitch_bytes", c_uint64),
        ("quantize", c_uint32),
        ("reserved", c_uint32),
        ("conversion_gain_dn_per_e", c_double),
        ("photons_per_unit", c_double),
        ("quantum_efficiency", c_double),
        ("full_well_e", c_double),
        ("crosstalk_fraction", c_double),
        ("prnu", c_double),
        ("mosaic_gain", c_double * 4),
        ("dark_current_e_per_s", c_double),
        ("dark_current_reference_temperature_c", c_double),
        ("dark_current_doubling_k", c_double),
        ("temperature_c", c_double),
        ("exposure_time_s", c_double),
        ("lag_fraction", c_double),
        ("gamma", c_double),
        ("dsnu_dn", c_double),
        ("column_offset_dn", c_double),
        ("row_noise_dn", c_double),
        ("column_noise_dn", c_double),
        ("read_noise_spread", c_double),
        ("shot_noise", c_uint32),
        ("effective_bits", c_uint32),
    ]


class ClspPipelineDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("pattern", c_void_p),
        ("phase", c_void_p),
        ("aperture", c_void_p),
        ("sensor", c_void_p),
        ("dots", c_void_p),
        ("materials", c_void_p),
        ("motion", c_void_p),
        ("lens", c_void_p),
        ("seed", c_uint64),
        ("line_count", c_uint32),
        ("sub_exposures", c_uint32),
        ("dephasing_rad", c_double),
        ("power_flicker", c_double),
        ("coherent_fraction", c_double),
        ("subsurface_length_px", c_double),
        ("subsurface_fraction", c_double),
        ("exposure_path", c_double),
        ("boiling_correlation_frames", c_double),
        ("airflow_rms_rad", c_double),
        ("airflow_scale_px", c_double),
        ("airflow_correlation_frames", c_double),
        ("vibration_rms_px", c_double),
        ("shutter_fraction", c_double),
        ("exposure_correlation", c_uint32),
        ("reserved_exposure", c_uint32),
        ("airflow_wind_px", c_double),
    ]


class ClspFrame(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("refresh", c_uint32),
        ("frame_index", c_uint64),
        ("geometry", POINTER(ClspGeometry)),
        ("irradiance", ClspImage),
        ("refresh_mask", ClspImage),
        ("output", ClspImage),
        ("motion", POINTER(ClspMotionInput)),
        ("material", ClspImage),
        ("illumination", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspStageTiming(ctypes.Structure):
    _fields_ = [
        ("stage", c_char * 32),
        ("milliseconds", c_double),
    ]


class ClspEffectParameter(ctypes.Structure):
    _fields_ = [
        ("name", c_char * 32),
        ("unit", c_char * 16),
        ("minimum", c_double),
        ("maximum", c_double),
        ("weak", c_double),
        ("strong", c_double),
    ]


class ClspEffectInfo(ctypes.Structure):
    _fields_ = [
        ("id", c_char * 32),
        ("stage", c_char * 16),
        ("summary", c_char * 128),
        ("kernel", c_char * 64),
        ("parameter_count", c_uint32),
        ("reserved", c_uint32),
        ("parameters", ClspEffectParameter * CLSP_MAX_EFFECT_PARAMETERS),
    ]


class ClspMoments(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("count", c_uint64),
        ("mean", c_double),
        ("standard_deviation", c_double),
        ("contrast", c_double),
        ("skewness", c_double),
        ("excess_kurtosis", c_double),
        ("minimum", c_double),
        ("maximum", c_double),
    ]


class ClspCaptureDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("bits", c_uint32),
        ("field", c_uint32),
        ("principal_point_given", c_uint32),
        ("pixel_pitch_m", c_double),
        ("f_number", c_double),
        ("wavelength_m", c_double),
        ("degree_of_polarization", c_double),
        ("black_level_dn", c_double),
        ("read_noise_dn", c_double),
        ("principal_point_x_px", c_double),
        ("principal_point_y_px", c_double),
    ]


class ClspCaptureSequence(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("scene", c_uint32),
        ("moving", c_uint32),
        ("frame_count", c_uint32),
        ("name", c_char_p),
        ("codes", POINTER(c_uint16)),
        ("mask", POINTER(c_uint8)),
        ("f_number", c_double),
        ("exposure_ms", c_double),
    ]


class ClspCaptureSequenceInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("scene", c_uint32),
        ("moving", c_uint32),
        ("frame_count", c_uint32),
        ("has_mask", c_uint32),
        ("reserved", c_uint32),
        ("f_number", c_double),
        ("exposure_ms", c_double),
        ("name", c_char * CLSP_MAX_CAPTURE_NAME),
    ]


class ClspHypothesisFrame(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("bits", c_uint32),
        ("sequence", c_uint32),
        ("scene", c_uint32),
        ("moving", c_uint32),
        ("frame_index", c_uint32),
        ("seed", c_uint64),
        ("parameter_count", c_uint32),
        ("reserved", c_uint32),
        ("sequence_name", c_char_p),
        ("values", POINTER(c_double)),
        ("pixels", POINTER(c_float)),
        ("f_number", c_double),
        ("pixel_pitch_m", c_double),
        ("wavelength_m", c_double),
    ]


HYPOTHESIS_FUNCTION = ctypes.CFUNCTYPE(c_int32, c_void_p, POINTER(ClspHypothesisFrame))


class ClspHypothesis(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("point", c_uint32),
        ("id", c_char_p),
        ("stage", c_char_p),
        ("summary", c_char_p),
        ("parameters", POINTER(ClspEffectParameter)),
        ("parameter_count", c_uint32),
        ("reserved", c_uint32),
        ("apply", HYPOTHESIS_FUNCTION),
        ("user_data", c_void_p),
        ("opencl_source", c_char_p),
    ]


class ClspDiagnoseDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("null_replicates", c_uint32),
        ("max_effects", c_uint32),
        ("threads", c_uint32),
        ("seed", c_uint64),
        ("level", c_double),
        ("without", POINTER(c_char_p)),
        ("without_count", c_uint32),
        ("hypothesis_count", c_uint32),
        ("hypotheses", POINTER(POINTER(ClspHypothesis))),
        ("progress", PROGRESS_FUNCTION),
        ("progress_data", c_void_p),
        ("evidence", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspDiagnosisSummary(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("verdict", c_uint32),
        ("detected", c_uint32),
        ("residual_detected", c_uint32),
        ("held_out", c_uint32),
        ("effect_count", c_uint32),
        ("equivalent_count", c_uint32),
        ("ranked_count", c_uint32),
        ("parameter_count", c_uint32),
        ("place_count", c_uint32),
        ("step_count", c_uint32),
        ("note_count", c_uint32),
        ("seed", c_uint64),
        ("level", c_double),
        ("p_value", c_double),
        ("distance", c_double),
        ("null_95", c_double),
        ("probability", c_double),
        ("distance_before", c_double),
        ("distance_after", c_double),
        ("fraction", c_double),
        ("fraction_95", c_double * 2),
        ("residual_p_value", c_double),
        ("seconds", c_double),
        ("black_level_dn", c_double),
        ("read_noise_dn", c_double),
        ("judged", c_uint32),
        ("reserved", c_uint32),
    ]


class ClspDiagnosisRanked(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("parameter_count", c_uint32),
        ("simulated", c_uint32),
        ("reserved", c_uint32),
        ("effect", c_char * 32),
        ("stage", c_char * 16),
        ("values", c_double * CLSP_MAX_EFFECT_PARAMETERS),
        ("probability", c_double),
        ("distance_after", c_double),
        ("gain", c_double),
    ]


class ClspDiagnosisParameter(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("effect", c_char * 32),
        ("name", c_char * 32),
        ("unit", c_char * 16),
        ("value", c_double),
        ("low", c_double),
        ("high", c_double),
    ]


class ClspDiagnosisPlace(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("stage", c_char * 16),
        ("sequence", c_char * CLSP_MAX_CAPTURE_NAME),
        ("statistic", c_char * 64),
        ("region", c_char * 32),
        ("unit", c_char * 32),
        ("real", c_double),
        ("sim", c_double),
        ("z", c_double),
        ("p_adjusted", c_double),
        ("z_after", c_double),
        ("distance_before", c_double),
        ("distance_after", c_double),
        ("fraction", c_double),
        ("fraction_95", c_double * 2),
    ]


class ClspDiagnosisStep(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("effect", c_char * 32),
        ("distance_after", c_double),
        ("fraction", c_double),
    ]


class ClspDoeDesignOrder(ctypes.Structure):
    _fields_ = [("m", c_int32), ("n", c_int32), ("weight", c_double)]


class ClspDoeDesignDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("levels", c_uint32),
        ("pixel_pitch_m", c_double),
        ("wavelength_m", c_double),
        ("beam_diameter_m", c_double),
        ("orders", POINTER(ClspDoeDesignOrder)),
        ("order_count", c_uint64),
        ("seed", c_uint64),
        ("feedback", c_double),
        ("rule", c_uint32),
        ("iterations", c_uint32),
        ("quantization_iterations", c_uint32),
        ("fix_phase_iteration", c_uint32),
        ("search_sweeps", c_uint32),
        ("compensate_envelope", c_uint32),
        ("mirror_orders", c_uint32),
        ("reserved", c_uint32),
        ("progress", PROGRESS_FUNCTION),
        ("progress_data", c_void_p),
    ]


class ClspDoeDesignReport(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("zero_order_wanted", c_uint32),
        ("order_count", c_uint64),
        ("step_count", c_uint64),
        ("efficiency", c_double),
        ("grid_efficiency", c_double),
        ("uniformity_rms", c_double),
        ("uniformity_peak_to_peak", c_double),
        ("weakest", c_double),
        ("strongest", c_double),
        ("zero_order", c_double),
        ("zero_order_relative", c_double),
        ("largest_ghost", c_double),
        ("largest_ghost_relative", c_double),
        ("ghost_m", c_int32),
        ("ghost_n", c_int32),
        ("other_orders", c_double),
        ("beyond", c_double),
        ("search_changes", c_uint64),
        ("search_sweeps", c_uint32),
        ("reserved", c_uint32),
        ("seconds", c_double),
    ]


class ClspDotLayoutDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("lattice", c_uint32),
        ("count", c_uint64),
        ("seed", c_uint64),
        ("width", c_uint32),
        ("height", c_uint32),
        ("pixel_pitch_m", c_double),
        ("wavelength_m", c_double),
        ("half_angle_x_rad", c_double),
        ("half_angle_y_rad", c_double),
        ("min_distance", c_double),
        ("beam_diameter_m", c_double),
        ("row_half_height", c_double),
        ("neighborhood_radius", c_double),
        ("tolerance", c_double),
        ("min_difference", c_double),
        ("point_symmetric", c_uint32),
        ("repair_rounds", c_uint32),
        ("progress", PROGRESS_FUNCTION),
        ("progress_data", c_void_p),
    ]


class ClspDotLayoutInfo(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_uint32),
        ("min_distance", c_double),
        ("mean_spacing", c_double),
        ("row_half_height", c_double),
        ("neighborhood_radius", c_double),
        ("tolerance", c_double),
        ("mean_neighbors", c_double),
        ("min_difference", c_double),
        ("mean_difference", c_double),
        ("pair_count", c_uint64),
        ("worst_first", c_uint64),
        ("worst_second", c_uint64),
        ("moved_count", c_uint64),
    ]


class ClspTuningSize(ctypes.Structure):
    _fields_ = [("width", c_uint32), ("height", c_uint32)]


class ClspTuningDesc(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("frames", c_uint32),
        ("sizes", POINTER(ClspTuningSize)),
        ("size_count", c_uint32),
        ("keep", c_uint32),
        ("relative_diameter", c_double),
        ("path", c_char_p),
        ("progress", PROGRESS_FUNCTION),
        ("progress_data", c_void_p),
    ]


STRUCTS: tuple[type[ctypes.Structure], ...] = (
    ClspErrorInfo,
    ClspImage,
    ClspDeviceInfo,
    ClspContextDesc,
    ClspContextInfo,
    ClspPhiloxDesc,
    ClspPatternDesc,
    ClspGeometry,
    ClspBeamProfile,
    ClspDoeDefects,
    ClspDoePatternDesc,
    ClspSpotPatternDesc,
    ClspDoePatternInfo,
    ClspDotsDesc,
    ClspDepthDesc,
    ClspDepthDot,
    ClspDepthPatternDot,
    ClspDepthSummary,
    ClspFieldGrid,
    ClspPhaseDesc,
    ClspPhaseAdvance,
    ClspMaterial,
    ClspMotionDesc,
    ClspMotionInput,
    ClspMotionOutput,
    ClspApertureDesc,
    ClspApertureInfo,
    ClspLensDesc,
    ClspSensorDesc,
    ClspPipelineDesc,
    ClspFrame,
    ClspStageTiming,
    ClspEffectParameter,
    ClspEffectInfo,
    ClspMoments,
    ClspCaptureDesc,
    ClspCaptureSequence,
    ClspCaptureSequenceInfo,
    ClspHypothesisFrame,
    ClspHypothesis,
    ClspDiagnoseDesc,
    ClspDiagnosisSummary,
    ClspDiagnosisRanked,
    ClspDiagnosisParameter,
    ClspDiagnosisPlace,
    ClspDiagnosisStep,
    ClspDoeDesignOrder,
    ClspDoeDesignDesc,
    ClspDoeDesignReport,
    ClspDotLayoutDesc,
    ClspDotLayoutInfo,
    ClspTuningSize,
    ClspTuningDesc,
)
"""Every struct of the C interface."""

# --- Functions ---

_HANDLE = c_void_p
_HANDLE_OUT = POINTER(c_void_p)
_WAIT = (c_uint32, POINTER(c_void_p), POINTER(c_void_p))  # num_events_in_wait_list, event_wait_list, event
_IMAGE = POINTER(ClspImage)


def _init(struct: type[ctypes.Structure]) -> tuple[Any, ...]:
    return (POINTER(struct), c_uint32)


# Functions that return a ClspStatus: their argument types.
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "clspGetLastError": (POINTER(ClspErrorInfo),),
    "clspGetVersion": (POINTER(c_uint32),) * 4,
    "clspDeviceList": (c_uint32, POINTER(ClspDeviceInfo), POINTER(c_uint32)),
    "clspDeviceExplain": (c_char_p, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspContextDescInit": _init(ClspContextDesc),
    "clspContextCreate": (POINTER(ClspContextDesc), _HANDLE_OUT),
    "clspContextRetain": (_HANDLE,),
    "clspContextRelease": (_HANDLE,),
    "clspContextGetInfo": (_HANDLE, POINTER(ClspContextInfo)),
    "clspQueueCreate": (_HANDLE, c_uint32, _HANDLE_OUT),
    "clspQueueFinish": (_HANDLE,),
    "clspQueueRelease": (_HANDLE,),
    "clspBufferCreate": (_HANDLE, c_uint64, _HANDLE_OUT),
    "clspBufferRelease": (_HANDLE,),
    "clspBufferEnqueueWrite": (_HANDLE, c_void_p, c_uint64, _HANDLE, c_uint64, *_WAIT),
    "clspBufferEnqueueRead": (_HANDLE, _HANDLE, c_uint64, c_uint64, c_void_p, *_WAIT),
    "clspBufferWrite": (_HANDLE, c_void_p, c_uint64, _HANDLE, c_uint64),
    "clspBufferRead": (_HANDLE, _HANDLE, c_uint64, c_uint64, c_void_p),
    "clspEventWait": (c_uint32, POINTER(c_void_p)),
    "clspEventRelease": (_HANDLE,),
    "clspPhiloxEnqueueBlocks": (
        _HANDLE,
        _HANDLE,
        _HANDLE,
        c_uint64,
        POINTER(c_uint32),
        c_uint64,
        c_uint64,
        _HANDLE,
        c_uint64,
        *_WAIT,
    ),
    "clspPhiloxDescInit": _init(ClspPhiloxDesc),
    "clspPhiloxEnqueueFill": (_HANDLE, _HANDLE, POINTER(ClspPhiloxDesc), _IMAGE, *_WAIT),
    "clspPatternDescInit": _init(ClspPatternDesc),
    "clspPatternCreate": (_HANDLE, POINTER(ClspPatternDesc), _HANDLE_OUT),
    "clspPatternRetain": (_HANDLE,),
    "clspPatternRelease": (_HANDLE,),
    "clspPatternSetPose": (_HANDLE, POINTER(c_double)),
    "clspGeometryInit": _init(ClspGeometry),
    "clspPatternEnqueueLookup": (_HANDLE, _HANDLE, POINTER(ClspGeometry), _IMAGE, *_WAIT),
    "clspBeamProfileInit": _init(ClspBeamProfile),
    "clspDoeDefectsInit": _init(ClspDoeDefects),
    "clspDoePatternDescInit": _init(ClspDoePatternDesc),
    "clspDoePatternCreate": (_HANDLE, POINTER(ClspDoePatternDesc), _HANDLE_OUT),
    "clspSpotPatternDescInit": _init(ClspSpotPatternDesc),
    "clspSpotPatternCreate": (_HANDLE, POINTER(ClspSpotPatternDesc), _HANDLE_OUT),
    "clspDoePatternRetain": (_HANDLE,),
    "clspDoePatternRelease": (_HANDLE,),
    "clspDoePatternGetInfo": (_HANDLE, POINTER(ClspDoePatternInfo)),
    "clspDoePatternGetTexels": (_HANDLE, c_uint64, POINTER(c_float)),
    "clspDoePatternGetDotShares": (_HANDLE, c_uint64, POINTER(c_double)),
    "clspDotsDescInit": _init(ClspDotsDesc),
    "clspDotsCreate": (_HANDLE, POINTER(ClspDotsDesc), _HANDLE_OUT),
    "clspDotsRetain": (_HANDLE,),
    "clspDotsRelease": (_HANDLE,),
    "clspDotsConfigure": (_HANDLE, POINTER(ClspDotsDesc)),
    "clspDotsEnqueueRender": (_HANDLE, _HANDLE, _IMAGE, *_WAIT),
    "clspDepthDescInit": _init(ClspDepthDesc),
    "clspDepthCreate": (_HANDLE, POINTER(ClspDepthDesc), _HANDLE_OUT),
    "clspDepthRetain": (_HANDLE,),
    "clspDepthRelease": (_HANDLE,),
    "clspDepthEnqueueDetect": (_HANDLE, _HANDLE, _IMAGE, *_WAIT),
    "clspDepthGetDots": (
        _HANDLE,
        _HANDLE,
        c_uint64,
        POINTER(ClspDepthDot),
        POINTER(c_uint64),
        POINTER(ClspDepthSummary),
    ),
    "clspDepthGetPatternDots": (_HANDLE, c_uint64, POINTER(ClspDepthPatternDot), POINTER(c_uint64)),
    "clspFieldGridCompute": (POINTER(ClspFieldGrid),),
    "clspPhaseDescInit": _init(ClspPhaseDesc),
    "clspPhaseCreate": (_HANDLE, POINTER(ClspPhaseDesc), _HANDLE_OUT),
    "clspPhaseRetain": (_HANDLE,),
    "clspPhaseRelease": (_HANDLE,),
    "clspPhaseEnqueueRefresh": (_HANDLE, _HANDLE, c_uint64, _IMAGE, *_WAIT),
    "clspPhaseAdvanceInit": _init(ClspPhaseAdvance),
    "clspPhaseEnqueueAdvance": (_HANDLE, _HANDLE, c_uint64, POINTER(ClspPhaseAdvance), *_WAIT),
    "clspPhaseCheck": (_HANDLE, _HANDLE),
    "clspPhaseEnqueueField": (_HANDLE, _HANDLE, c_uint32, _IMAGE, *_WAIT),
    "clspPhaseGetStateSize": (_HANDLE, POINTER(c_uint64)),
    "clspPhaseEnqueueSave": (_HANDLE, _HANDLE, _HANDLE, c_uint64, *_WAIT),
    "clspPhaseEnqueueRestore": (_HANDLE, _HANDLE, _HANDLE, c_uint64, *_WAIT),
    "clspMaterialInit": _init(ClspMaterial),
    "clspMaterialTableCreate": (_HANDLE, POINTER(ClspMaterial), c_uint32, _HANDLE_OUT),
    "clspMaterialTableRetain": (_HANDLE,),
    "clspMaterialTableRelease": (_HANDLE,),
    "clspMotionDescInit": _init(ClspMotionDesc),
    "clspMotionInputInit": _init(ClspMotionInput),
    "clspMotionOutputInit": _init(ClspMotionOutput),
    "clspMotionCreate": (_HANDLE, POINTER(ClspMotionDesc), _HANDLE_OUT),
    "clspMotionRetain": (_HANDLE,),
    "clspMotionRelease": (_HANDLE,),
    "clspMotionEnqueueCompute": (_HANDLE, _HANDLE, POINTER(ClspMotionInput), POINTER(ClspMotionOutput), *_WAIT),
    "clspMotionCheck": (_HANDLE, _HANDLE),
    "clspApertureDescInit": _init(ClspApertureDesc),
    "clspApertureCreate": (_HANDLE, POINTER(ClspApertureDesc), _HANDLE_OUT),
    "clspApertureRetain": (_HANDLE,),
    "clspApertureRelease": (_HANDLE,),
    "clspApertureGetInfo": (_HANDLE, POINTER(ClspApertureInfo)),
    "clspApertureSetWorkspace": (_HANDLE, _HANDLE, c_uint64, c_uint64),
    "clspApertureEnqueuePupil": (_HANDLE, _HANDLE, _IMAGE, *_WAIT),
    "clspApertureEnqueueIntensity": (_HANDLE, _HANDLE, _HANDLE, _IMAGE, _IMAGE, *_WAIT),
    "clspLensDescInit": _init(ClspLensDesc),
    "clspLensCreate": (_HANDLE, POINTER(ClspLensDesc), _HANDLE_OUT),
    "clspLensRetain": (_HANDLE,),
    "clspLensRelease": (_HANDLE,),
    "clspLensConfigure": (_HANDLE, POINTER(ClspLensDesc)),
    "clspLensEnqueueDistort": (_HANDLE, _HANDLE, c_uint32, _IMAGE, _IMAGE, *_WAIT),
    "clspLensEnqueueFinish": (_HANDLE, _HANDLE, _IMAGE, c_uint32, _IMAGE, *_WAIT),
    "clspLensDistortPoints": (_HANDLE, POINTER(c_double), c_uint64, POINTER(c_double)),
    "clspLensUndistortPoints": (_HANDLE, POINTER(c_double), c_uint64, POINTER(c_double)),
    "clspSensorDescInit": _init(ClspSensorDesc),
    "clspSensorDescFromProfile": (POINTER(ClspSensorDesc), c_uint32, c_char_p),
    "clspSensorMosaicFromBayer": (c_uint32, c_double, c_double, c_double, POINTER(c_double)),
    "clspSensorDarkFrameFromCaptures": (
        POINTER(c_uint16),
        c_uint32,
        c_uint32,
        c_uint32,
        c_uint64,
        c_uint64,
        c_double,
        POINTER(c_float),
        POINTER(c_double),
    ),
    "clspSensorCreate": (_HANDLE, POINTER(ClspSensorDesc), _HANDLE_OUT),
    "clspSensorRetain": (_HANDLE,),
    "clspSensorRelease": (_HANDLE,),
    "clspSensorSetExposureGain": (_HANDLE, c_double),
    "clspSensorConfigure": (_HANDLE, POINTER(ClspSensorDesc)),
    "clspSensorResetLag": (_HANDLE,),
    "clspSensorEnqueueExpose": (_HANDLE, _HANDLE, _IMAGE, c_uint64, _IMAGE, *_WAIT),
    "clspSensorEnqueueDemosaic": (_HANDLE, _HANDLE, _IMAGE, c_uint32, _IMAGE, *_WAIT),
    "clspPipelineDescInit": _init(ClspPipelineDesc),
    "clspPipelineCreate": (_HANDLE, POINTER(ClspPipelineDesc), _HANDLE_OUT),
    "clspPipelineRetain": (_HANDLE,),
    "clspPipelineRelease": (_HANDLE,),
    "clspFrameInit": _init(ClspFrame),
    "clspPipelineEnqueueFrame": (_HANDLE, _HANDLE, POINTER(ClspFrame), *_WAIT),
    "clspPipelineEnqueueFrames": (_HANDLE, _HANDLE, c_uint32, POINTER(ClspFrame), *_WAIT),
    "clspPipelineWarmUp": (_HANDLE, _HANDLE, POINTER(ClspFrame)),
    "clspPipelineCheck": (_HANDLE, _HANDLE),
    "clspPipelineGetTimings": (_HANDLE, c_uint32, POINTER(ClspStageTiming), POINTER(c_uint32)),
    "clspEffectGetCount": (POINTER(c_uint32),),
    "clspEffectGetInfo": (c_uint32, POINTER(ClspEffectInfo)),
    "clspPipelineSetEffect": (_HANDLE, c_char_p, POINTER(c_double), c_uint32),
    "clspPipelineClearEffect": (_HANDLE, c_char_p),
    "clspCaptureDescInit": _init(ClspCaptureDesc),
    "clspCaptureSequenceInit": _init(ClspCaptureSequence),
    "clspCaptureCreate": (POINTER(ClspCaptureDesc), _HANDLE_OUT),
    "clspCaptureOpen": (c_char_p, _HANDLE_OUT),
    "clspCaptureRetain": (_HANDLE,),
    "clspCaptureRelease": (_HANDLE,),
    "clspCaptureAddSequence": (_HANDLE, POINTER(ClspCaptureSequence)),
    "clspCaptureSetDots": (_HANDLE, c_double, c_uint64, POINTER(c_double)),
    "clspCaptureValidate": (_HANDLE,),
    "clspCaptureWrite": (_HANDLE, c_char_p, c_uint32),
    "clspCaptureGetDesc": (_HANDLE, POINTER(ClspCaptureDesc)),
    "clspCaptureGetDots": (_HANDLE, POINTER(c_double), c_uint64, POINTER(c_double), POINTER(c_uint64)),
    "clspCaptureGetSequenceCount": (_HANDLE, POINTER(c_uint32)),
    "clspCaptureGetSequence": (_HANDLE, c_uint32, POINTER(ClspCaptureSequenceInfo)),
    "clspCaptureGetCodes": (_HANDLE, c_uint32, c_uint64, POINTER(c_uint16)),
    "clspCaptureGetMask": (_HANDLE, c_uint32, c_uint64, POINTER(c_uint8)),
    "clspCaptureGetSummaryJson": (_HANDLE, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspHypothesisInit": _init(ClspHypothesis),
    "clspDiagnoseDescInit": _init(ClspDiagnoseDesc),
    "clspDiagnose": (_HANDLE, _HANDLE, POINTER(ClspDiagnoseDesc), _HANDLE_OUT),
    "clspCompare": (_HANDLE, _HANDLE, _HANDLE, POINTER(ClspDiagnoseDesc), _HANDLE_OUT),
    "clspDiagnosisRetain": (_HANDLE,),
    "clspDiagnosisRelease": (_HANDLE,),
    "clspDiagnosisGetSummary": (_HANDLE, POINTER(ClspDiagnosisSummary)),
    "clspDiagnosisGetEffect": (_HANDLE, c_uint32, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspDiagnosisGetEquivalent": (_HANDLE, c_uint32, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspDiagnosisGetNote": (_HANDLE, c_uint32, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspDiagnosisGetRanked": (_HANDLE, c_uint32, POINTER(ClspDiagnosisRanked)),
    "clspDiagnosisGetParameter": (_HANDLE, c_uint32, POINTER(ClspDiagnosisParameter)),
    "clspDiagnosisGetPlace": (_HANDLE, c_uint32, POINTER(ClspDiagnosisPlace)),
    "clspDiagnosisGetStep": (_HANDLE, c_uint32, POINTER(ClspDiagnosisStep)),
    "clspDiagnosisGetReportJson": (_HANDLE, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspDiagnosisWriteReport": (_HANDLE, c_char_p),
    "clspDiagnosisWriteHtml": (_HANDLE, c_char_p),
    "clspDoeDesignDescInit": _init(ClspDoeDesignDesc),
    "clspDoeDesignCreate": (_HANDLE, POINTER(ClspDoeDesignDesc), _HANDLE_OUT),
    "clspDoeDesignEvaluate": (_HANDLE, POINTER(ClspDoeDesignDesc), POINTER(c_float), c_uint64, _HANDLE_OUT),
    "clspDoeDesignRetain": (_HANDLE,),
    "clspDoeDesignRelease": (_HANDLE,),
    "clspDoeDesignGetReport": (_HANDLE, POINTER(ClspDoeDesignReport)),
    "clspDoeDesignGetPhase": (_HANDLE, c_uint64, POINTER(c_float)),
    "clspDoeDesignGetOrders": (_HANDLE, c_uint64, POINTER(ClspDoeDesignOrder), POINTER(c_double)),
    "clspDoeDesignGetHistory": (_HANDLE, c_uint64, POINTER(c_double), POINTER(c_double)),
    "clspDoeDesignSnapDirections": (
        c_uint32,
        c_uint32,
        c_double,
        c_double,
        c_uint64,
        POINTER(c_double),
        POINTER(ClspDoeDesignOrder),
        POINTER(c_double),
    ),
    "clspDotLayoutDescInit": _init(ClspDotLayoutDesc),
    "clspDotLayoutCreate": (
        POINTER(ClspDotLayoutDesc),
        POINTER(c_double),
        POINTER(c_int32),
        POINTER(ClspDotLayoutInfo),
    ),
    "clspStatisticsMoments": (_HANDLE, _HANDLE, _IMAGE, _IMAGE, POINTER(ClspMoments)),
    "clspStatisticsHistogram": (_HANDLE, _HANDLE, _IMAGE, _IMAGE, c_double, c_double, c_uint32, POINTER(c_uint64)),
    "clspStatisticsAutocovariance": (_HANDLE, _HANDLE, _IMAGE, c_uint32, POINTER(c_float)),
    "clspTuningDescInit": _init(ClspTuningDesc),
    "clspTuningRun": (_HANDLE, POINTER(ClspTuningDesc), _HANDLE_OUT),
    "clspTuningRetain": (_HANDLE,),
    "clspTuningRelease": (_HANDLE,),
    "clspTuningGetJson": (_HANDLE, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspTuningGetPath": (_HANDLE, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspTuningExplain": (_HANDLE, c_uint32, c_uint32, c_uint64, POINTER(c_char), POINTER(c_uint64)),
    "clspTuningGetRecordPath": (_HANDLE, c_uint64, POINTER(c_char), POINTER(c_uint64)),
}
"""The functions that return a status, with their argument types."""

OTHER_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "clspStatusString": (c_char_p, (c_int32,)),
    "clspDepthReasonString": (c_char_p, (c_uint32,)),
    "clspDepthWarningString": (c_char_p, (c_uint32,)),
}
"""The functions that return something else: (return type, argument types)."""

# These touch no OpenCL object; all others start the OpenCL runtime of this process.
_HOST_ONLY = {name for name in FUNCTIONS if name.endswith("Init") or name.startswith("clspCapture")} | {
    "clspGetLastError",
    "clspGetVersion",
    "clspFieldGridCompute",
    "clspDoeDesignSnapDirections",
    "clspDotLayoutCreate",
    "clspEffectGetCount",
    "clspEffectGetInfo",
    "clspSensorDescFromProfile",
    "clspSensorMosaicFromBayer",
    "clspSensorDarkFrameFromCaptures",
}

# --- Loading ---

_lock = threading.Lock()
_library: ctypes.CDLL | None = None
_opencl_started = False
_forked = False


def _after_fork_in_child() -> None:
    global _forked, _lock
    _lock = threading.Lock()  # another thread of the parent may have held it
    _forked = _forked or _opencl_started


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)


def was_forked() -> bool:
    """True in a child of fork() whose parent had used OpenCL."""
    return _forked


def refuse_fork() -> None:
    """Raises :class:`InvalidStateError` in a child of fork() whose parent had used OpenCL.

    The threads of an OpenCL runtime do not survive a fork, and a call would hang for ever.
    """
    if _forked:
        raise errors.InvalidStateError(
            "this process was forked from one that had already used OpenCL, which does not survive a fork; start "
            'workers with the "spawn" or "forkserver" method (multiprocessing.get_context("spawn"), '
            'DataLoader(multiprocessing_context="spawn")), or use clspeckle in the workers alone'
        )


def file_names() -> tuple[str, ...]:
    """Names that the shared library may have on this platform, best first."""
    if sys.platform == "win32":
        return ("clspeckle.dll", "libclspeckle.dll")
    if sys.platform == "darwin":
        return (f"libclspeckle.{ABI_VERSION}.dylib", "libclspeckle.dylib")
    return (f"libclspeckle.so.{ABI_VERSION}", "libclspeckle.so")


def candidates() -> list[tuple[str, str]]:
    """Where the library is looked for, in order: (what the place is, path or name)."""
    chosen = os.environ.get("CLSPECKLE_LIBRARY")
    if chosen:
        # Whoever names a file wants that file: nothing else is tried.
        return [("environment variable CLSPECKLE_LIBRARY", chosen)]
    package = Path(__file__).resolve().parent
    places = [("inside the package", package)]
    # bindings/python/src/clspeckle/_library.py of a source checkout
    parents = package.parents
    if len(parents) > 3 and (parents[3] / "capi" / "include" / "clspeckle" / "clspeckle.h").is_file():
        places.append(("build folder of the source checkout", parents[3] / "build" / "lib"))
    found = [(what, str(folder / name)) for what, folder in places for name in file_names()]
    return found + [("the system's loader", name) for name in file_names()]


def _load() -> ctypes.CDLL:
    tried: list[str] = []
    for what, path in candidates():
        if os.path.dirname(path) and not os.path.isfile(path):
            tried.append(f"{path} ({what}): no such file")
            continue
        try:
            loaded = ctypes.CDLL(path)
        except OSError as error:
            tried.append(f"{path} ({what}): {error}")
            continue
        _bind(loaded, path)
        return loaded
    raise errors.LibraryLoadError(
        "the shared library clspeckle was not found or did not load. Tried:\n  "
        + "\n  ".join(tried)
        + "\nInstall the package from a checkout (pip install ./bindings/python), or build the library (cmake -B build "
        "&& cmake --build build), or set CLSPECKLE_LIBRARY to its file."
    )


def _bind(loaded: ctypes.CDLL, path: str) -> None:
    def signature(name: str, restype: Any, argtypes: tuple[Any, ...]) -> Any:
        try:
            function = getattr(loaded, name)
        except AttributeError:
            raise errors.LibraryLoadError(
                f"{path} has no function {name}: it is not clspeckle, or older than this Python package; install the "
                "library and the package from the same release"
            ) from None
        function.restype = restype
        function.argtypes = argtypes
        return function

    get_version = signature("clspGetVersion", c_int32, FUNCTIONS["clspGetVersion"])
    abi = c_uint32()
    if get_version(None, None, None, ctypes.byref(abi)) != CLSP_SUCCESS or abi.value != ABI_VERSION:
        raise errors.LibraryLoadError(
            f"{path} has ABI number {abi.value}, this Python package needs {ABI_VERSION}; install the library and the "
            "package from the same release"
        )
    for name, argtypes in FUNCTIONS.items():
        signature(name, c_int32, argtypes)
    for name, (restype, argtypes) in OTHER_FUNCTIONS.items():
        signature(name, restype, argtypes)


def library() -> ctypes.CDLL:
    """The loaded library; loads it on the first call. May be called from any thread."""
    global _library
    if _library is None:
        with _lock:
            if _library is None:
                _library = _load()
    return _library


def call(name: str, *arguments: Any) -> None:
    """Calls a function that returns a status, and raises its error."""
    global _opencl_started
    function = getattr(library(), name)
    if name in _HOST_ONLY:
        status: int = function(*arguments)
    else:
        refuse_fork()
        started, _opencl_started = _opencl_started, True
        status = function(*arguments) if started else _without_interrupts(function, arguments)
    if status != CLSP_SUCCESS:
        raise last_error(status, name)


def _without_interrupts(function: Any, arguments: tuple[Any, ...]) -> int:
    """The first call that starts OpenCL.

    A driver's threads inherit which signals are blocked, and so does the linker that they run: otherwise Ctrl-C at a
    terminal ends the linker, too, and PoCL then ends the process.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return int(function(*arguments))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def last_error(status: int, name: str) -> errors.ClspeckleError:
    """The exception for the last failing call of this thread."""
    info = ClspErrorInfo()
    info.struct_size = ctypes.sizeof(info)
    if library().clspGetLastError(ctypes.byref(info)) != CLSP_SUCCESS or info.status != status:
        return errors.from_status(status, status_string(status), function=name)
    return errors.from_status(
        status,
        text(info.message),
        function=text(info.function) or name,
        opencl_code=info.opencl_code,
        build_log=text(info.build_log),
    )


def status_string(status: int) -> str:
    """The C name of a status, for example "CLSP_ERROR_NO_DEVICE"."""
    return text(library().clspStatusString(status))


def text(value: bytes | None) -> str:
    """A C string as text; drivers do not always write UTF-8."""
    return (value or b"").decode("utf-8", "replace")


# These have a size but no defaults.
_FILLED_BY_THE_LIBRARY = (
    ClspErrorInfo,
    ClspDeviceInfo,
    ClspContextInfo,
    ClspApertureInfo,
    ClspDoePatternInfo,
    ClspMoments,
    ClspDepthSummary,
    ClspCaptureSequenceInfo,
    ClspHypothesisFrame,
    ClspDiagnosisSummary,
    ClspDiagnosisRanked,
    ClspDiagnosisParameter,
    ClspDiagnosisPlace,
    ClspDiagnosisStep,
    ClspDoeDesignReport,
    ClspDotLayoutInfo,
)

Struct = TypeVar("Struct", bound=ctypes.Structure)


def initialized(struct: type[Struct]) -> Struct:
    """A struct with its size and, if it describes something, the defaults that the C library writes."""
    value = struct()
    if struct in _FILLED_BY_THE_LIBRARY:
        value.struct_size = ctypes.sizeof(value)
    else:
        call("c" + struct.__name__[1:] + "Init", ctypes.byref(value), ctypes.sizeof(value))
    return value


def text_of(name: str, *arguments: Any) -> str:
    """The text of a function that ends with (capacity, text, length)."""
    length = c_uint64()
    call(name, *arguments, 0, None, ctypes.byref(length))
    buffer = ctypes.create_string_buffer(max(1, length.value))
    call(name, *arguments, len(buffer), buffer, None)
    return text(buffer.value)


def release(name: str, pointer: int) -> None:
    """Gives an object back; used by finalizers, so it never raises, and does nothing in a forked child."""
    if _library is not None and not _forked:
        getattr(_library, name)(pointer)
