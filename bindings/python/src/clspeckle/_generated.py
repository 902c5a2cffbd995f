"""The C headers, name by name, for ctypes. Written by scripts/generate_bindings.py: do not edit."""

# fmt: off

from __future__ import annotations

from ctypes import CFUNCTYPE, Structure
from ctypes import POINTER as _P
from ctypes import c_char as _char
from ctypes import c_char_p as _text
from ctypes import c_double as _f64
from ctypes import c_float as _f32
from ctypes import c_int32 as _i32
from ctypes import c_uint8 as _u8
from ctypes import c_uint16 as _u16
from ctypes import c_uint32 as _u32
from ctypes import c_uint64 as _u64
from ctypes import c_void_p as _void
from typing import Any

VERSION = "0.1.0"
ABI_VERSION = 0
CLSP_SUCCESS = 0
CLSP_LOG_WARNING, CLSP_LOG_INFO = 1, 2
CLSP_FORMAT_NONE, CLSP_FORMAT_UINT8, CLSP_FORMAT_UINT16, CLSP_FORMAT_UINT32, CLSP_FORMAT_FLOAT32 = 0, 1, 2, 3, 4
CLSP_FORMAT_FLOAT32X2, CLSP_FORMAT_FLOAT32X3, CLSP_FORMAT_FLOAT32X4 = 5, 6, 7
CLSP_PUPIL_CIRCLE, CLSP_PUPIL_IMAGE, CLSP_PUPIL_POLYGON, CLSP_PUPIL_RING = 0, 1, 2, 3
CLSP_NORMALIZATION_TRANSMISSION, CLSP_NORMALIZATION_UNIT_MEAN = 0, 1
CLSP_SCENE_DARK, CLSP_SCENE_FLAT, CLSP_SCENE_BOARD, CLSP_SCENE_DOTS = 0, 1, 2, 3
CLSP_MAX_CAPTURE_NAME, CLSP_MAX_DIRECTIONS = 64, 1000000
CLSP_NO_DOT = 0xffffffff
CLSP_DOT_SATURATED, CLSP_DOT_BORDER, CLSP_DOT_MERGED, CLSP_DOT_FIT_FAILED, CLSP_DOT_FIXED_SHAPE = 1, 2, 4, 8, 16
CLSP_DEPTH_REASON_PLACED, CLSP_DEPTH_REASON_FIT_FAILED, CLSP_DEPTH_REASON_NO_CANDIDATE = 0, 1, 2
CLSP_DEPTH_REASON_UNSUPPORTED, CLSP_DEPTH_REASON_AMBIGUOUS, CLSP_DEPTH_REASON_CONFLICT = 3, 4, 5
CLSP_DEPTH_REASON_OUT_OF_VIEW, CLSP_DEPTH_REASON_NOT_SEEN, CLSP_DEPTH_WARNING_NO_DOTS = 6, 7, 1
CLSP_DEPTH_WARNING_FEW_PLACED, CLSP_DEPTH_WARNING_EPIPOLAR, CLSP_DEPTH_WARNING_SATURATED = 2, 4, 8
CLSP_DEPTH_WARNING_MERGED = 16
CLSP_MAX_EFFECT_PARAMETERS = 4
CLSP_VERDICT_NONE, CLSP_VERDICT_NAMED, CLSP_VERDICT_AMBIGUOUS, CLSP_VERDICT_UNKNOWN = 0, 1, 2, 3
CLSP_HYPOTHESIS_IRRADIANCE, CLSP_HYPOTHESIS_INTENSITY, CLSP_HYPOTHESIS_CODES = 0, 1, 2
CLSP_WINDOW_AUTO, CLSP_WINDOW_WHOLE, CLSP_WINDOW_GIVEN = 0, 1, 2
CLSP_FRAMES_AUTO = 0xffffffff
CLSP_MAX_HYPOTHESES = 64
CLSP_BEAM_GAUSSIAN, CLSP_BEAM_FLAT_CIRCLE, CLSP_BEAM_FLAT_SQUARE, CLSP_BEAM_SUPER_GAUSSIAN = 0, 1, 2, 3
CLSP_BEAM_SKEWED, CLSP_BEAM_IMAGE = 4, 5
CLSP_DOE_EVALUATION_AUTO, CLSP_DOE_EVALUATION_ORDERS, CLSP_DOE_EVALUATION_APERTURE = 0, 1, 2
CLSP_MAX_DOE_SAMPLES, CLSP_MAX_DOE_LINES = 8192, 16
CLSP_DOE_SOURCE_COMPUTED, CLSP_DOE_SOURCE_MEMORY, CLSP_DOE_SOURCE_DISK, CLSP_DOE_RULE_GS = 0, 1, 2, 0
CLSP_DOE_RULE_GSW, CLSP_DOE_RULE_NOGRETTE, CLSP_DOE_RULE_KIM = 1, 2, 3
CLSP_MAX_DOE_SIDE, CLSP_MAX_DOE_LEVELS, CLSP_MAX_DOE_ORDERS, CLSP_MAX_LAYOUT_DOTS = 8192, 256, 1000000, 100000
CLSP_MAX_DOTS = 1000000
CLSP_EXTERNAL_MEMORY_OPAQUE_FD, CLSP_EXTERNAL_MEMORY_DMA_BUF = 1, 2
CLSP_SHARED_GL, CLSP_SHARED_EXTERNAL = 0, 1
CLSP_LENS_RADIUS_CORNER, CLSP_LENS_RADIUS_FOCAL_LENGTH = 0, 1
CLSP_INTERPOLATION_NEAREST, CLSP_INTERPOLATION_LINEAR, CLSP_INTERPOLATION_CUBIC = 0, 1, 2
CLSP_MAX_MATERIALS = 256
CLSP_PROJECTION_TANGENT_PLANE, CLSP_PROJECTION_DIRECTION_COSINES = 0, 1
CLSP_QUANTITY_RADIANT_INTENSITY, CLSP_QUANTITY_PLANE_IRRADIANCE = 0, 1
CLSP_FILTER_BILINEAR, CLSP_FILTER_AREA = 0, 1
CLSP_DEPTH_ALONG_AXIS, CLSP_DEPTH_ALONG_RAY = 0, 1
CLSP_MOTION_CORRELATE, CLSP_MOTION_REPLACE = 0, 1
CLSP_FIELD_CIRCULAR_GAUSSIAN, CLSP_FIELD_UNIT_PHASOR = 0, 1
CLSP_DYNAMICS_REPLACE, CLSP_DYNAMICS_CONTINUOUS = 0, 1
CLSP_DISTRIBUTION_BITS, CLSP_DISTRIBUTION_UNIFORM, CLSP_DISTRIBUTION_NORMAL = 0, 1, 2
CLSP_BAYER_RGGB, CLSP_BAYER_BGGR, CLSP_BAYER_GRBG, CLSP_BAYER_GBRG = 1, 2, 3, 4
CLSP_EXPOSURE_CORRELATION_FIELD, CLSP_EXPOSURE_CORRELATION_GAUSSIAN = 0, 1
CLSP_REFRESH_MASK, CLSP_REFRESH_ALL = 0, 1
CLSP_ILLUMINATION_LASER, CLSP_ILLUMINATION_INCOHERENT, CLSP_ILLUMINATION_DARK = 0, 1, 2
CLSP_PROFILE_MAP_DARK, CLSP_PROFILE_MAP_GAIN = 1, 2
CLSP_DISK_CACHE_AUTO, CLSP_DISK_CACHE_OFF, CLSP_DISK_CACHE_ON = 0, 1, 2
CLSP_QUEUE_PROFILING, CLSP_QUEUE_OUT_OF_ORDER = 1, 2
CLSP_MAX_TUNING_SIZES, CLSP_MAX_TUNING_FRAMES = 64, 10000

PROGRESS_FUNCTION = CFUNCTYPE(_i32, _void, _text, _f64)

LOG_FUNCTION = CFUNCTYPE(None, _void, _u32, _text)


class ClspErrorInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("status", _i32), ("opencl_code", _i32), ("reserved", _u32), ("function", _text),
        ("message", _text), ("build_log", _text),
    ]


class ClspImage(Structure):
    _fields_ = [
        ("mem", _void), ("offset_bytes", _u64), ("pitch_bytes", _u64), ("width", _u32), ("height", _u32),
        ("format", _u32), ("reserved", _u32),
    ]


class ClspApertureDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("oversampling", _u32), ("guard_px", _u32),
        ("pupil", _u32), ("normalization", _u32), ("workspace_from_host", _u32), ("relative_diameter", _f64),
        ("f_number", _f64), ("pixel_pitch_m", _f64), ("wavelength_m", _f64), ("soft_rim", _f64),
        ("degree_of_polarization", _f64), ("pupil_image", _P(_f32)), ("pupil_width", _u32), ("pupil_height", _u32),
        ("pupil_pitch_bytes", _u64), ("blade_count", _u32), ("reserved_blades", _u32), ("blade_rotation_rad", _f64),
        ("blade_curvature", _f64), ("obstruction_ratio", _f64), ("defocus_waves", _f64), ("zernike_waves", _f64 * 12),
        ("fill_factor", _f64), ("pupil_image_imaginary", _P(_f32)),
    ]


class ClspApertureInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("grid_width", _u32), ("grid_height", _u32), ("pupil_samples", _u32),
        ("relative_diameter", _f64), ("mean_transmission", _f64), ("workspace_bytes", _u64),
        ("fft_backend", _char * 32), ("fft_reason", _char * 192), ("fft_engine", _char * 32), ("column_lines", _u32),
        ("column_work_items", _u32), ("row_lines", _u32), ("row_work_items", _u32), ("fft_source", _char * 256),
    ]


class ClspCaptureDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("bits", _u32), ("field", _u32),
        ("principal_point_given", _u32), ("pixel_pitch_m", _f64), ("f_number", _f64), ("wavelength_m", _f64),
        ("degree_of_polarization", _f64), ("black_level_dn", _f64), ("read_noise_dn", _f64),
        ("principal_point_x_px", _f64), ("principal_point_y_px", _f64),
    ]


class ClspCaptureSequence(Structure):
    _fields_ = [
        ("struct_size", _u32), ("scene", _u32), ("moving", _u32), ("frame_count", _u32), ("name", _text),
        ("codes", _P(_u16)), ("mask", _P(_u8)), ("f_number", _f64), ("exposure_ms", _f64),
    ]


class ClspCaptureSequenceInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("scene", _u32), ("moving", _u32), ("frame_count", _u32), ("has_mask", _u32),
        ("reserved", _u32), ("f_number", _f64), ("exposure_ms", _f64), ("name", _char * 64),
    ]


class ClspDepthDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("max_dots", _u32), ("projection", _u32),
        ("reserved", _u32), ("direction_count", _u64), ("directions", _P(_f64)), ("laser_from_camera", _f64 * 12),
        ("fx_px", _f64), ("fy_px", _f64), ("cx_px", _f64), ("cy_px", _f64), ("near_m", _f64), ("far_m", _f64),
        ("dot_sigma_px", _f64), ("min_amplitude_dn", _f64), ("threshold_sigmas", _f64), ("min_correlation", _f64),
        ("read_noise_dn", _f64), ("dn_per_electron", _f64), ("black_level_dn", _f64), ("saturation_dn", _f64),
        ("epipolar_tolerance_px", _f64), ("min_confidence", _f64), ("relative_diameter", _f64),
        ("speckle_contrast", _f64),
    ]


class ClspDepthDot(Structure):
    _fields_ = [
        ("x_px", _f64), ("y_px", _f64), ("covariance_px2", _f64 * 3), ("centroid_x_px", _f64), ("centroid_y_px", _f64),
        ("amplitude_dn", _f64), ("amplitude_sd_dn", _f64), ("background_dn", _f64), ("shape_px2", _f64 * 3),
        ("correlation", _f64), ("misfit", _f64), ("depth_m", _f64), ("depth_sd_m", _f64), ("position_m", _f64 * 3),
        ("position_sd_m", _f64 * 3), ("epipolar_error_px", _f64), ("epipolar_sd_px", _f64), ("confidence", _f64),
        ("flags", _u32), ("reason", _u32), ("dot_index", _u32), ("candidate_count", _u32), ("iterations", _u32),
        ("reserved", _u32),
    ]


class ClspDepthPatternDot(Structure):
    _fields_ = [
        ("reason", _u32), ("detected_index", _u32),
    ]


class ClspDepthSummary(Structure):
    _fields_ = [
        ("struct_size", _u32), ("warnings", _u32), ("detected_count", _u64), ("fitted_count", _u64),
        ("placed_count", _u64), ("saturated_count", _u64), ("merged_count", _u64), ("pattern_in_view_count", _u64),
        ("median_epipolar_error_px", _f64), ("expected_epipolar_error_px", _f64), ("median_sigma_px", _f64),
        ("median_centre_sd_px", _f64),
    ]


class ClspEffectParameter(Structure):
    _fields_ = [
        ("name", _char * 32), ("unit", _char * 16), ("minimum", _f64), ("maximum", _f64), ("weak", _f64),
        ("strong", _f64),
    ]


class ClspEffectInfo(Structure):
    _fields_ = [
        ("id", _char * 32), ("stage", _char * 16), ("summary", _char * 128), ("kernel", _char * 64),
        ("parameter_count", _u32), ("whole_parameters", _u32), ("parameters", ClspEffectParameter * 4),
    ]


class ClspCameraTraits(Structure):
    _fields_ = [
        ("struct_size", _u32), ("bits", _u32), ("effective_bits", _u32), ("polarization_count", _u32),
        ("fill_factor", _f64), ("saturation_dn", _f64), ("gamma", _f64), ("cubic_nonlinearity", _f64),
        ("ambient_dn", _f64), ("nonlinearity_power", _u32), ("reserved_nonlinearity", _u32),
    ]


class ClspEffectSetting(Structure):
    _fields_ = [
        ("id", _text), ("values", _P(_f64)), ("count", _u32), ("reserved", _u32),
    ]


class ClspHypothesisFrame(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("bits", _u32), ("sequence", _u32), ("scene", _u32),
        ("moving", _u32), ("frame_index", _u32), ("seed", _u64), ("parameter_count", _u32), ("reserved", _u32),
        ("sequence_name", _text), ("values", _P(_f64)), ("pixels", _P(_f32)), ("f_number", _f64),
        ("pixel_pitch_m", _f64), ("wavelength_m", _f64),
    ]

HYPOTHESIS_FUNCTION = CFUNCTYPE(_i32, _void, _P(ClspHypothesisFrame))


class ClspHypothesis(Structure):
    _fields_ = [
        ("struct_size", _u32), ("point", _u32), ("id", _text), ("stage", _text), ("summary", _text),
        ("parameters", _P(ClspEffectParameter)), ("parameter_count", _u32), ("reserved", _u32),
        ("apply", HYPOTHESIS_FUNCTION), ("user_data", _void), ("opencl_source", _text),
    ]


class ClspDiagnoseDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("null_replicates", _u32), ("max_effects", _u32), ("threads", _u32), ("seed", _u64),
        ("level", _f64), ("without", _P(_text)), ("without_count", _u32), ("hypothesis_count", _u32),
        ("hypotheses", _P(_P(ClspHypothesis))), ("progress", PROGRESS_FUNCTION), ("progress_data", _void),
        ("evidence", _u32), ("reserved", _u32), ("window", _u32), ("frames", _u32), ("window_x", _u32),
        ("window_y", _u32), ("window_width", _u32), ("window_height", _u32), ("profile", _void),
        ("tolerance_file", _text),
    ]


class ClspDiagnosisSummary(Structure):
    _fields_ = [
        ("struct_size", _u32), ("verdict", _u32), ("detected", _u32), ("residual_detected", _u32), ("held_out", _u32),
        ("effect_count", _u32), ("equivalent_count", _u32), ("ranked_count", _u32), ("parameter_count", _u32),
        ("place_count", _u32), ("step_count", _u32), ("note_count", _u32), ("seed", _u64), ("level", _f64),
        ("p_value", _f64), ("distance", _f64), ("null_95", _f64), ("probability", _f64), ("distance_before", _f64),
        ("distance_after", _f64), ("fraction", _f64), ("fraction_95", _f64 * 2), ("residual_p_value", _f64),
        ("seconds", _f64), ("black_level_dn", _f64), ("read_noise_dn", _f64), ("judged", _u32), ("reserved", _u32),
    ]


class ClspDiagnosisRanked(Structure):
    _fields_ = [
        ("struct_size", _u32), ("parameter_count", _u32), ("simulated", _u32), ("reserved", _u32),
        ("effect", _char * 32), ("stage", _char * 16), ("values", _f64 * 4), ("probability", _f64),
        ("distance_after", _f64), ("gain", _f64),
    ]


class ClspDiagnosisParameter(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("effect", _char * 32), ("name", _char * 32), ("unit", _char * 16),
        ("value", _f64), ("low", _f64), ("high", _f64),
    ]


class ClspDiagnosisPlace(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("stage", _char * 16), ("sequence", _char * 64),
        ("statistic", _char * 64), ("region", _char * 32), ("unit", _char * 32), ("real", _f64), ("sim", _f64),
        ("z", _f64), ("p_adjusted", _f64), ("z_after", _f64), ("distance_before", _f64), ("distance_after", _f64),
        ("fraction", _f64), ("fraction_95", _f64 * 2),
    ]


class ClspDiagnosisStep(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("effect", _char * 32), ("distance_after", _f64), ("fraction", _f64),
    ]


class ClspBeamProfile(Structure):
    _fields_ = [
        ("struct_size", _u32), ("kind", _u32), ("covariance_xx_m2", _f64), ("covariance_xy_m2", _f64),
        ("covariance_yy_m2", _f64), ("width_m", _f64), ("height_m", _f64), ("order", _f64), ("skew_x", _f64),
        ("skew_y", _f64), ("m_squared", _f64), ("image_width", _u32), ("image_height", _u32), ("image", _P(_f32)),
        ("image_pitch_bytes", _u64),
    ]


class ClspDoeDefects(Structure):
    _fields_ = [
        ("struct_size", _u32), ("levels", _u32), ("relative_depth_error", _f64), ("rounding_sigma_m", _f64),
        ("etch_noise_rms_m", _f64), ("refractive_index", _f64), ("dispersion_per_m", _f64), ("seed", _u64),
        ("feature_samples", _u32), ("reserved", _u32),
    ]


class ClspDoePatternDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("periodic", _u32), ("phase", _P(_f32)),
        ("phase_pitch_bytes", _u64), ("pixel_pitch_m", _f64), ("wavelength_m", _f64), ("dot_count", _u64),
        ("dot_orders", _P(_i32)), ("dot_directions", _P(_f64)), ("dot_weights", _P(_f64)),
        ("beam", _P(ClspBeamProfile)), ("defects", _P(ClspDoeDefects)), ("design_levels", _u32), ("evaluation", _u32),
        ("line_count", _u32), ("oversampling", _u32), ("line_wavelengths_m", _P(_f64)), ("line_powers", _P(_f64)),
        ("doe_width_m", _f64), ("doe_height_m", _f64), ("power_w", _f64), ("image_width", _u32), ("image_height", _u32),
        ("half_extent_x", _f64), ("half_extent_y", _f64), ("pixel_envelope", _u32), ("reserved", _u32),
        ("max_memory_bytes", _u64), ("cache_dir", _text), ("progress", PROGRESS_FUNCTION), ("progress_data", _void),
    ]


class ClspSpotPatternDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("count", _u64), ("directions", _P(_f64)), ("powers", _P(_f64)),
        ("beam", _P(ClspBeamProfile)), ("wavelength_m", _f64), ("power_w", _f64), ("image_width", _u32),
        ("image_height", _u32), ("half_extent_x", _f64), ("half_extent_y", _f64),
    ]


class ClspDoePatternInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("source", _u32), ("image_width", _u32), ("image_height", _u32), ("half_extent_x", _f64),
        ("half_extent_y", _f64), ("power_w", _f64), ("dots", _f64), ("zero_order", _f64), ("ghosts", _f64),
        ("scatter", _f64), ("inside_image", _f64), ("uniformity_rms", _f64), ("divergence_x_rad", _f64),
        ("divergence_y_rad", _f64), ("m_squared", _f64), ("order_spacing_x", _f64), ("order_spacing_y", _f64),
        ("dot_count", _u64), ("device_memory_bytes", _u64),
    ]


class ClspDoeDesignOrder(Structure):
    _fields_ = [
        ("m", _i32), ("n", _i32), ("weight", _f64),
    ]


class ClspDoeDesignDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("levels", _u32), ("pixel_pitch_m", _f64),
        ("wavelength_m", _f64), ("beam_diameter_m", _f64), ("orders", _P(ClspDoeDesignOrder)), ("order_count", _u64),
        ("seed", _u64), ("feedback", _f64), ("rule", _u32), ("iterations", _u32), ("quantization_iterations", _u32),
        ("fix_phase_iteration", _u32), ("search_sweeps", _u32), ("compensate_envelope", _u32), ("mirror_orders", _u32),
        ("reserved", _u32), ("progress", PROGRESS_FUNCTION), ("progress_data", _void),
    ]


class ClspDoeDesignReport(Structure):
    _fields_ = [
        ("struct_size", _u32), ("zero_order_wanted", _u32), ("order_count", _u64), ("step_count", _u64),
        ("efficiency", _f64), ("grid_efficiency", _f64), ("uniformity_rms", _f64), ("uniformity_peak_to_peak", _f64),
        ("weakest", _f64), ("strongest", _f64), ("zero_order", _f64), ("zero_order_relative", _f64),
        ("largest_ghost", _f64), ("largest_ghost_relative", _f64), ("ghost_m", _i32), ("ghost_n", _i32),
        ("other_orders", _f64), ("beyond", _f64), ("search_changes", _u64), ("search_sweeps", _u32), ("reserved", _u32),
        ("seconds", _f64),
    ]


class ClspDotLayoutDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("lattice", _u32), ("count", _u64), ("seed", _u64), ("width", _u32), ("height", _u32),
        ("pixel_pitch_m", _f64), ("wavelength_m", _f64), ("half_angle_x_rad", _f64), ("half_angle_y_rad", _f64),
        ("min_distance", _f64), ("beam_diameter_m", _f64), ("row_half_height", _f64), ("neighborhood_radius", _f64),
        ("tolerance", _f64), ("min_difference", _f64), ("point_symmetric", _u32), ("repair_rounds", _u32),
        ("progress", PROGRESS_FUNCTION), ("progress_data", _void),
    ]


class ClspDotLayoutInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("min_distance", _f64), ("mean_spacing", _f64),
        ("row_half_height", _f64), ("neighborhood_radius", _f64), ("tolerance", _f64), ("mean_neighbors", _f64),
        ("min_difference", _f64), ("mean_difference", _f64), ("pair_count", _u64), ("worst_first", _u64),
        ("worst_second", _u64), ("moved_count", _u64),
    ]


class ClspDotsDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("principal_point_given", _u32), ("count", _u64),
        ("positions_px", _P(_f64)), ("sigmas_px", _P(_f64)), ("peaks", _P(_f64)), ("sigma_px", _f64), ("scale", _f64),
        ("principal_point_x_px", _f64), ("principal_point_y_px", _f64), ("relative_wavelength_shift", _f64),
        ("beam_skew", _f64), ("beam_skew_angle_rad", _f64), ("beam_flatness", _f64),
        ("zero_order_relative_intensity", _f64), ("ghost_relative_intensity", _f64), ("ghost_offset_given", _u32),
        ("reserved", _u32), ("ghost_offset_x_px", _f64), ("ghost_offset_y_px", _f64), ("scatter_fraction", _f64),
    ]


class ClspInteropInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("cl_images", _u32), ("gl_textures", _u32), ("external_memory", _u32),
        ("cl_images_reason", _char * 256), ("gl_textures_reason", _char * 256), ("external_memory_reason", _char * 256),
    ]


class ClspLensDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("radius_unit", _u32), ("cos4_falloff", _u32),
        ("principal_point_given", _u32), ("principal_point_x_px", _f64), ("principal_point_y_px", _f64),
        ("focal_length_x_px", _f64), ("focal_length_y_px", _f64), ("k1", _f64), ("k2", _f64), ("k3", _f64),
        ("p1", _f64), ("p2", _f64), ("vignetting_corner_loss", _f64), ("glare_fraction", _f64),
        ("glare_scale_px", _f64), ("ambient", _f64),
    ]


class ClspMaterial(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("roughness_rms_m", _f64), ("degree_of_polarization", _f64),
        ("correlation_time_s", _f64), ("lateral_correlation_length_m", _f64), ("axial_correlation_length_m", _f64),
        ("rotation_correlation_angle_rad", _f64), ("subsurface_fraction", _f64),
    ]


class ClspPatternDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("projection", _u32), ("quantity", _u32), ("width", _u32), ("height", _u32),
        ("reserved", _u32), ("texels", _P(_f32)), ("texels_pitch_bytes", _u64), ("half_extent_x", _f64),
        ("half_extent_y", _f64), ("power_scale", _f64), ("laser_from_geometry", _f64 * 12), ("filter", _u32),
        ("filter_taps", _u32),
    ]


class ClspGeometry(Structure):
    _fields_ = [
        ("struct_size", _u32), ("depth_kind", _u32), ("position", ClspImage), ("depth", ClspImage),
        ("normal", ClspImage), ("albedo", ClspImage), ("visibility", ClspImage), ("fx_px", _f64), ("fy_px", _f64),
        ("cx_px", _f64), ("cy_px", _f64),
    ]


class ClspMotionDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("rule", _u32), ("translate", _u32),
        ("depth_kind", _u32), ("materials", _void), ("fx_px", _f64), ("fy_px", _f64), ("cx_px", _f64), ("cy_px", _f64),
        ("replace_threshold", _f64), ("occlusion_tolerance", _f64),
    ]


class ClspMotionInput(Structure):
    _fields_ = [
        ("struct_size", _u32), ("transform_count", _u32), ("previous_from_current", _P(_f64)), ("frame_time_s", _f64),
        ("roll_from_motion", _u32), ("reserved", _u32), ("position", ClspImage), ("depth", ClspImage),
        ("normal", ClspImage), ("material", ClspImage), ("motion", ClspImage), ("previous_position", ClspImage),
        ("previous_depth", ClspImage), ("previous_normal", ClspImage), ("previous_material", ClspImage),
    ]


class ClspMotionOutput(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("path", ClspImage), ("correlation", ClspImage),
        ("shift", ClspImage), ("displacement", ClspImage), ("mask", ClspImage),
    ]


class ClspFieldGrid(Structure):
    _fields_ = [
        ("width", _u32), ("height", _u32), ("oversampling", _u32), ("guard_px", _u32), ("grid_width", _u32),
        ("grid_height", _u32),
    ]


class ClspPhaseDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("oversampling", _u32), ("guard_px", _u32),
        ("field", _u32), ("polarization_count", _u32), ("reserved", _u32), ("seed", _u64), ("dynamics", _u32),
        ("translate", _u32),
    ]


class ClspPhaseAdvance(Structure):
    _fields_ = [
        ("struct_size", _u32), ("substep", _u32), ("uniform_path", _f64), ("uniform_correlation", _f64),
        ("path", ClspImage), ("correlation", ClspImage), ("shift", ClspImage), ("mask", ClspImage),
    ]


class ClspPhiloxDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("distribution", _u32), ("seed", _u64), ("frame_index", _u64), ("stream", _u32),
        ("local_size", _u32),
    ]


class ClspSensorDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("bits", _u32), ("seed", _u64),
        ("exposure_gain_dn", _f64), ("saturation_dn", _f64), ("black_level_dn", _f64), ("read_noise_dn", _f64),
        ("hot_pixel_fraction", _f64), ("hot_pixel_mean_dn", _f64), ("cold_pixel_fraction", _f64),
        ("float_full_scale", _f64), ("dark_frame_dn", _P(_f32)), ("dark_frame_pitch_bytes", _u64), ("quantize", _u32),
        ("reserved", _u32), ("conversion_gain_dn_per_e", _f64), ("photons_per_unit", _f64),
        ("quantum_efficiency", _f64), ("full_well_e", _f64), ("crosstalk_fraction", _f64), ("prnu", _f64),
        ("mosaic_gain", _f64 * 4), ("dark_current_e_per_s", _f64), ("dark_current_reference_temperature_c", _f64),
        ("dark_current_doubling_k", _f64), ("temperature_c", _f64), ("exposure_time_s", _f64), ("lag_fraction", _f64),
        ("gamma", _f64), ("dsnu_dn", _f64), ("column_offset_dn", _f64), ("row_noise_dn", _f64),
        ("column_noise_dn", _f64), ("read_noise_spread", _f64), ("shot_noise", _u32), ("effective_bits", _u32),
        ("column_prnu", _f64), ("row_prnu", _f64), ("row_offset_dn", _f64), ("dull_pixel_fraction", _f64),
        ("cubic_nonlinearity", _f64), ("periodic_offset_dn", _f64), ("periodic_frequency_x", _f64),
        ("periodic_frequency_y", _f64), ("telegraph_fraction", _f64), ("telegraph_step_dn", _f64),
        ("telegraph_centered", _u32), ("reserved_telegraph", _u32), ("gain_map", _P(_f32)),
        ("gain_map_pitch_bytes", _u64), ("code_width_wave", _f64), ("code_width_period", _f64), ("widest_code", _f64),
        ("nonlinearity_power", _u32), ("reserved_nonlinearity", _u32), ("read_noise_correlation", _f64),
    ]


class ClspPipelineDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("pattern", _void), ("phase", _void), ("aperture", _void),
        ("sensor", _void), ("dots", _void), ("materials", _void), ("motion", _void), ("lens", _void), ("seed", _u64),
        ("line_count", _u32), ("sub_exposures", _u32), ("dephasing_rad", _f64), ("power_flicker", _f64),
        ("coherent_fraction", _f64), ("subsurface_length_px", _f64), ("subsurface_fraction", _f64),
        ("exposure_path", _f64), ("boiling_correlation_frames", _f64), ("airflow_rms_rad", _f64),
        ("airflow_scale_px", _f64), ("airflow_correlation_frames", _f64), ("vibration_rms_px", _f64),
        ("shutter_fraction", _f64), ("exposure_correlation", _u32), ("reserved_exposure", _u32),
        ("airflow_wind_px", _f64),
    ]


class ClspFrame(Structure):
    _fields_ = [
        ("struct_size", _u32), ("refresh", _u32), ("frame_index", _u64), ("geometry", _P(ClspGeometry)),
        ("irradiance", ClspImage), ("refresh_mask", ClspImage), ("output", ClspImage), ("motion", _P(ClspMotionInput)),
        ("material", ClspImage), ("illumination", _u32), ("reserved", _u32),
    ]


class ClspStageTiming(Structure):
    _fields_ = [
        ("stage", _char * 32), ("milliseconds", _f64),
    ]


class ClspProfileInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("width", _u32), ("height", _u32), ("bits", _u32), ("field", _u32),
        ("oversampling", _u32), ("effect_count", _u32), ("hypothesis_count", _u32), ("sequence_count", _u32),
        ("verdict", _u32), ("residual_detected", _u32), ("reserved", _u32), ("seed", _u64), ("pixel_pitch_m", _f64),
        ("f_number", _f64), ("wavelength_m", _f64), ("degree_of_polarization", _f64), ("principal_point_x_px", _f64),
        ("principal_point_y_px", _f64), ("black_level_dn", _f64), ("read_noise_dn", _f64), ("fill_factor", _f64),
        ("level", _f64), ("version", _char * 16), ("capture", _char * 256), ("maps", _u32), ("reserved_maps", _u32),
    ]


class ClspProfileEffect(Structure):
    _fields_ = [
        ("struct_size", _u32), ("parameter_count", _u32), ("named", _u32), ("conditional", _u32), ("id", _char * 32),
        ("values", _f64 * 4), ("low", _f64 * 4), ("high", _f64 * 4),
    ]


class ClspProfileSequence(Structure):
    _fields_ = [
        ("struct_size", _u32), ("scene", _u32), ("moving", _u32), ("reserved", _u32), ("f_number", _f64),
        ("exposure_ms", _f64), ("mean_dn", _f64), ("light_dn", _f64), ("gain_dn", _f64), ("name", _char * 64),
    ]


class ClspProfileMap(Structure):
    _fields_ = [
        ("struct_size", _u32), ("map", _u32), ("frame_count", _u32), ("reserved", _u32), ("standard_error", _f64),
        ("path", _char * 4096),
    ]


class ClspDeviceInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("usable", _u32), ("type", _u64), ("global_memory_bytes", _u64),
        ("max_allocation_bytes", _u64), ("local_memory_bytes", _u64), ("max_work_group_size", _u64),
        ("compute_units", _u32), ("rank", _u32), ("platform_id", _void), ("device_id", _void), ("selector", _char * 16),
        ("name", _char * 128), ("vendor", _char * 128), ("version", _char * 128), ("driver_version", _char * 128),
        ("platform_name", _char * 128), ("reason", _char * 256),
    ]


class ClspContextDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("disk_cache", _u32), ("cl_context_handle", _void), ("cl_device", _void),
        ("device", _text), ("kernel_dir", _text), ("cache_dir", _text), ("log", LOG_FUNCTION), ("log_data", _void),
    ]


class ClspContextInfo(Structure):
    _fields_ = [
        ("struct_size", _u32), ("programs_built", _u32), ("programs_from_cache", _u32), ("allocation_count", _u32),
        ("allocated_bytes", _u64), ("cl_context_handle", _void), ("cl_device", _void), ("device_name", _char * 128),
        ("platform_name", _char * 128),
    ]


class ClspMoments(Structure):
    _fields_ = [
        ("struct_size", _u32), ("reserved", _u32), ("count", _u64), ("mean", _f64), ("standard_deviation", _f64),
        ("contrast", _f64), ("skewness", _f64), ("excess_kurtosis", _f64), ("minimum", _f64), ("maximum", _f64),
    ]


class ClspTuningSize(Structure):
    _fields_ = [
        ("width", _u32), ("height", _u32),
    ]


class ClspTuningDesc(Structure):
    _fields_ = [
        ("struct_size", _u32), ("frames", _u32), ("sizes", _P(ClspTuningSize)), ("size_count", _u32), ("keep", _u32),
        ("relative_diameter", _f64), ("path", _text), ("progress", PROGRESS_FUNCTION), ("progress_data", _void),
    ]


# The functions that return a status: their argument types.
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "clspGetLastError": (_P(ClspErrorInfo),),
    "clspGetVersion": (_P(_u32), _P(_u32), _P(_u32), _P(_u32)),
    "clspApertureDescInit": (_P(ClspApertureDesc), _u32),
    "clspApertureCreate": (_void, _P(ClspApertureDesc), _P(_void)),
    "clspApertureRetain": (_void,),
    "clspApertureRelease": (_void,),
    "clspApertureGetInfo": (_void, _P(ClspApertureInfo)),
    "clspApertureSetWorkspace": (_void, _void, _u64, _u64),
    "clspApertureEnqueuePupil": (_void, _void, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspApertureEnqueueIntensity": (_void, _void, _void, _P(ClspImage), _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspCaptureDescInit": (_P(ClspCaptureDesc), _u32),
    "clspCaptureSequenceInit": (_P(ClspCaptureSequence), _u32),
    "clspCaptureCreate": (_P(ClspCaptureDesc), _P(_void)),
    "clspCaptureOpen": (_text, _P(_void)),
    "clspCaptureOpenWithProgress": (_text, PROGRESS_FUNCTION, _void, _P(_void)),
    "clspCaptureRetain": (_void,),
    "clspCaptureRelease": (_void,),
    "clspCaptureAddSequence": (_void, _P(ClspCaptureSequence)),
    "clspCaptureSetDots": (_void, _f64, _u64, _P(_f64)),
    "clspCaptureValidate": (_void,),
    "clspCaptureWrite": (_void, _text, _u32),
    "clspCaptureGetDesc": (_void, _P(ClspCaptureDesc)),
    "clspCaptureGetDots": (_void, _P(_f64), _u64, _P(_f64), _P(_u64)),
    "clspCaptureGetSequenceCount": (_void, _P(_u32)),
    "clspCaptureGetSequence": (_void, _u32, _P(ClspCaptureSequenceInfo)),
    "clspCaptureGetCodes": (_void, _u32, _u64, _P(_u16)),
    "clspCaptureGetMask": (_void, _u32, _u64, _P(_u8)),
    "clspCaptureGetSummaryJson": (_void, _u64, _P(_char), _P(_u64)),
    "clspCaptureGetEmva1288Json": (_void, _u64, _P(_char), _P(_u64)),
    "clspCaptureGetEmva1288Xml": (_void, _u64, _P(_char), _P(_u64)),
    "clspDepthDescInit": (_P(ClspDepthDesc), _u32),
    "clspDepthCreate": (_void, _P(ClspDepthDesc), _P(_void)),
    "clspDepthRetain": (_void,),
    "clspDepthRelease": (_void,),
    "clspDepthEnqueueDetect": (_void, _void, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspDepthGetDots": (_void, _void, _u64, _P(ClspDepthDot), _P(_u64), _P(ClspDepthSummary)),
    "clspDepthGetPatternDots": (_void, _u64, _P(ClspDepthPatternDot), _P(_u64)),
    "clspEffectGetCount": (_P(_u32),),
    "clspEffectGetInfo": (_u32, _P(ClspEffectInfo)),
    "clspEffectGetScenes": (_text, _P(_u32), _P(_u32)),
    "clspCameraTraitsInit": (_P(ClspCameraTraits), _u32),
    "clspEffectChangeTraits": (_text, _P(_f64), _u32, _P(ClspCameraTraits)),
    "clspPipelineSetEffect": (_void, _text, _P(_f64), _u32),
    "clspPipelineSetEffects": (_void, _u32, _P(ClspEffectSetting)),
    "clspPipelineClearEffect": (_void, _text),
    "clspHypothesisInit": (_P(ClspHypothesis), _u32),
    "clspPipelineSetHypothesis": (_void, _P(ClspHypothesis), _P(_f64), _u32),
    "clspDiagnoseDescInit": (_P(ClspDiagnoseDesc), _u32),
    "clspDiagnose": (_void, _void, _P(ClspDiagnoseDesc), _P(_void)),
    "clspCompare": (_void, _void, _void, _P(ClspDiagnoseDesc), _P(_void)),
    "clspDiagnosisRetain": (_void,),
    "clspDiagnosisRelease": (_void,),
    "clspDiagnosisGetSummary": (_void, _P(ClspDiagnosisSummary)),
    "clspDiagnosisGetEffect": (_void, _u32, _u64, _P(_char), _P(_u64)),
    "clspDiagnosisGetEquivalent": (_void, _u32, _u64, _P(_char), _P(_u64)),
    "clspDiagnosisGetNote": (_void, _u32, _u64, _P(_char), _P(_u64)),
    "clspDiagnosisGetRanked": (_void, _u32, _P(ClspDiagnosisRanked)),
    "clspDiagnosisGetParameter": (_void, _u32, _P(ClspDiagnosisParameter)),
    "clspDiagnosisGetPlace": (_void, _u32, _P(ClspDiagnosisPlace)),
    "clspDiagnosisGetStep": (_void, _u32, _P(ClspDiagnosisStep)),
    "clspDiagnosisGetReportJson": (_void, _u64, _P(_char), _P(_u64)),
    "clspDiagnosisWriteReport": (_void, _text),
    "clspDiagnosisWriteHtml": (_void, _text),
    "clspDiagnosisGetProfile": (_void, _P(_void)),
    "clspBeamProfileInit": (_P(ClspBeamProfile), _u32),
    "clspDoeDefectsInit": (_P(ClspDoeDefects), _u32),
    "clspDoePatternDescInit": (_P(ClspDoePatternDesc), _u32),
    "clspDoePatternCreate": (_void, _P(ClspDoePatternDesc), _P(_void)),
    "clspSpotPatternDescInit": (_P(ClspSpotPatternDesc), _u32),
    "clspSpotPatternCreate": (_void, _P(ClspSpotPatternDesc), _P(_void)),
    "clspDoePatternRetain": (_void,),
    "clspDoePatternRelease": (_void,),
    "clspDoePatternGetInfo": (_void, _P(ClspDoePatternInfo)),
    "clspDoePatternGetTexels": (_void, _u64, _P(_f32)),
    "clspDoePatternGetDotShares": (_void, _u64, _P(_f64)),
    "clspDoeDesignDescInit": (_P(ClspDoeDesignDesc), _u32),
    "clspDoeDesignCreate": (_void, _P(ClspDoeDesignDesc), _P(_void)),
    "clspDoeDesignEvaluate": (_void, _P(ClspDoeDesignDesc), _P(_f32), _u64, _P(_void)),
    "clspDoeDesignRetain": (_void,),
    "clspDoeDesignRelease": (_void,),
    "clspDoeDesignGetReport": (_void, _P(ClspDoeDesignReport)),
    "clspDoeDesignGetPhase": (_void, _u64, _P(_f32)),
    "clspDoeDesignGetOrders": (_void, _u64, _P(ClspDoeDesignOrder), _P(_f64)),
    "clspDoeDesignGetHistory": (_void, _u64, _P(_f64), _P(_f64)),
    "clspDoeDesignSnapDirections": (_u32, _u32, _f64, _f64, _u64, _P(_f64), _P(ClspDoeDesignOrder), _P(_f64)),
    "clspDotLayoutDescInit": (_P(ClspDotLayoutDesc), _u32),
    "clspDotLayoutCreate": (_P(ClspDotLayoutDesc), _P(_f64), _P(_i32), _P(ClspDotLayoutInfo)),
    "clspDotsDescInit": (_P(ClspDotsDesc), _u32),
    "clspDotsCreate": (_void, _P(ClspDotsDesc), _P(_void)),
    "clspDotsRetain": (_void,),
    "clspDotsRelease": (_void,),
    "clspDotsConfigure": (_void, _P(ClspDotsDesc)),
    "clspDotsEnqueueRender": (_void, _void, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspContextGetInteropInfo": (_void, _P(ClspInteropInfo)),
    "clspClImageEnqueueImport": (_void, _void, _void, _u32, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspClImageEnqueueExport": (_void, _void, _P(ClspImage), _void, _u32, _P(_void), _P(_void)),
    "clspClImageCreateFromGl": (_void, _u64, _u32, _i32, _u32, _P(_void)),
    "clspBufferCreateFromFd": (_void, _u32, _i32, _u64, _P(_void)),
    "clspSharedEnqueueAcquire": (_void, _void, _u32, _u32, _P(_void), _u32, _P(_void), _P(_void)),
    "clspSharedEnqueueRelease": (_void, _void, _u32, _u32, _P(_void), _u32, _P(_void), _P(_void)),
    "clspLensDescInit": (_P(ClspLensDesc), _u32),
    "clspLensCreate": (_void, _P(ClspLensDesc), _P(_void)),
    "clspLensRetain": (_void,),
    "clspLensRelease": (_void,),
    "clspLensConfigure": (_void, _P(ClspLensDesc)),
    "clspLensEnqueueDistort": (_void, _void, _u32, _P(ClspImage), _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspLensEnqueueFinish": (_void, _void, _P(ClspImage), _u32, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspLensDistortPoints": (_void, _P(_f64), _u64, _P(_f64)),
    "clspLensUndistortPoints": (_void, _P(_f64), _u64, _P(_f64)),
    "clspMaterialInit": (_P(ClspMaterial), _u32),
    "clspMaterialTableCreate": (_void, _P(ClspMaterial), _u32, _P(_void)),
    "clspMaterialTableRetain": (_void,),
    "clspMaterialTableRelease": (_void,),
    "clspPatternDescInit": (_P(ClspPatternDesc), _u32),
    "clspPatternCreate": (_void, _P(ClspPatternDesc), _P(_void)),
    "clspPatternRetain": (_void,),
    "clspPatternRelease": (_void,),
    "clspPatternSetPose": (_void, _P(_f64)),
    "clspGeometryInit": (_P(ClspGeometry), _u32),
    "clspPatternEnqueueLookup": (_void, _void, _P(ClspGeometry), _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspMotionDescInit": (_P(ClspMotionDesc), _u32),
    "clspMotionCreate": (_void, _P(ClspMotionDesc), _P(_void)),
    "clspMotionRetain": (_void,),
    "clspMotionRelease": (_void,),
    "clspMotionInputInit": (_P(ClspMotionInput), _u32),
    "clspMotionOutputInit": (_P(ClspMotionOutput), _u32),
    "clspMotionEnqueueCompute": (_void, _void, _P(ClspMotionInput), _P(ClspMotionOutput), _u32, _P(_void), _P(_void)),
    "clspMotionCheck": (_void, _void),
    "clspFieldGridCompute": (_P(ClspFieldGrid),),
    "clspPhaseDescInit": (_P(ClspPhaseDesc), _u32),
    "clspPhaseCreate": (_void, _P(ClspPhaseDesc), _P(_void)),
    "clspPhaseRetain": (_void,),
    "clspPhaseRelease": (_void,),
    "clspPhaseEnqueueRefresh": (_void, _void, _u64, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspPhaseAdvanceInit": (_P(ClspPhaseAdvance), _u32),
    "clspPhaseEnqueueAdvance": (_void, _void, _u64, _P(ClspPhaseAdvance), _u32, _P(_void), _P(_void)),
    "clspPhaseCheck": (_void, _void),
    "clspPhaseEnqueueField": (_void, _void, _u32, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspPhaseGetStateSize": (_void, _P(_u64)),
    "clspPhaseEnqueueSave": (_void, _void, _void, _u64, _u32, _P(_void), _P(_void)),
    "clspPhaseEnqueueRestore": (_void, _void, _void, _u64, _u32, _P(_void), _P(_void)),
    "clspPhiloxEnqueueBlocks": (
        _void, _void, _void, _u64, _P(_u32), _u64, _u64, _void, _u64, _u32, _P(_void), _P(_void),
    ),
    "clspPhiloxDescInit": (_P(ClspPhiloxDesc), _u32),
    "clspPhiloxEnqueueFill": (_void, _void, _P(ClspPhiloxDesc), _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspSensorDescInit": (_P(ClspSensorDesc), _u32),
    "clspSensorDescFromProfile": (_P(ClspSensorDesc), _u32, _text),
    "clspSensorMosaicFromBayer": (_u32, _f64, _f64, _f64, _P(_f64)),
    "clspSensorDarkFrameFromCaptures": (_P(_u16), _u32, _u32, _u32, _u64, _u64, _f64, _P(_f32), _P(_f64)),
    "clspSensorCreate": (_void, _P(ClspSensorDesc), _P(_void)),
    "clspSensorRetain": (_void,),
    "clspSensorRelease": (_void,),
    "clspSensorSetExposureGain": (_void, _f64),
    "clspSensorConfigure": (_void, _P(ClspSensorDesc)),
    "clspSensorResetLag": (_void,),
    "clspSensorEnqueueExpose": (_void, _void, _P(ClspImage), _u64, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspSensorEnqueueDemosaic": (_void, _void, _P(ClspImage), _u32, _P(ClspImage), _u32, _P(_void), _P(_void)),
    "clspPipelineDescInit": (_P(ClspPipelineDesc), _u32),
    "clspPipelineCreate": (_void, _P(ClspPipelineDesc), _P(_void)),
    "clspPipelineRetain": (_void,),
    "clspPipelineRelease": (_void,),
    "clspFrameInit": (_P(ClspFrame), _u32),
    "clspPipelineEnqueueFrame": (_void, _void, _P(ClspFrame), _u32, _P(_void), _P(_void)),
    "clspPipelineEnqueueFrames": (_void, _void, _u32, _P(ClspFrame), _u32, _P(_void), _P(_void)),
    "clspPipelineWarmUp": (_void, _void, _P(ClspFrame)),
    "clspPipelineCheck": (_void, _void),
    "clspSimulate": (_void, _u32, _u32, _P(_f32), _P(ClspApertureDesc), _P(ClspSensorDesc), _u64, _u64, _P(_u16)),
    "clspPipelineGetTimings": (_void, _u32, _P(ClspStageTiming), _P(_u32)),
    "clspProfileOpen": (_text, _P(_void)),
    "clspProfileRetain": (_void,),
    "clspProfileRelease": (_void,),
    "clspProfileGetInfo": (_void, _P(ClspProfileInfo)),
    "clspProfileGetEffect": (_void, _u32, _P(ClspProfileEffect)),
    "clspProfileGetSequence": (_void, _u32, _P(ClspProfileSequence)),
    "clspProfileGetJson": (_void, _u64, _P(_char), _P(_u64)),
    "clspProfileWrite": (_void, _text),
    "clspProfileGetMap": (_void, _u32, _P(ClspProfileMap), _P(_f32)),
    "clspProfileDescribe": (
        _void, _text, _P(ClspPhaseDesc), _P(ClspApertureDesc), _P(ClspLensDesc), _P(ClspSensorDesc),
    ),
    "clspPipelineSetProfile": (_void, _void),
    "clspPipelineSetProfileMaps": (_void, _void, _u32),
    "clspDeviceList": (_u32, _P(ClspDeviceInfo), _P(_u32)),
    "clspDeviceExplain": (_text, _u64, _P(_char), _P(_u64)),
    "clspContextDescInit": (_P(ClspContextDesc), _u32),
    "clspContextCreate": (_P(ClspContextDesc), _P(_void)),
    "clspContextRetain": (_void,),
    "clspContextRelease": (_void,),
    "clspContextGetInfo": (_void, _P(ClspContextInfo)),
    "clspQueueCreate": (_void, _u32, _P(_void)),
    "clspQueueFinish": (_void,),
    "clspQueueRelease": (_void,),
    "clspBufferCreate": (_void, _u64, _P(_void)),
    "clspBufferRelease": (_void,),
    "clspBufferEnqueueWrite": (_void, _void, _u64, _void, _u64, _u32, _P(_void), _P(_void)),
    "clspBufferEnqueueRead": (_void, _void, _u64, _u64, _void, _u32, _P(_void), _P(_void)),
    "clspBufferWrite": (_void, _void, _u64, _void, _u64),
    "clspBufferRead": (_void, _void, _u64, _u64, _void),
    "clspEventWait": (_u32, _P(_void)),
    "clspEventRelease": (_void,),
    "clspStatisticsMoments": (_void, _void, _P(ClspImage), _P(ClspImage), _P(ClspMoments)),
    "clspStatisticsHistogram": (_void, _void, _P(ClspImage), _P(ClspImage), _f64, _f64, _u32, _P(_u64)),
    "clspStatisticsAutocovariance": (_void, _void, _P(ClspImage), _u32, _P(_f32)),
    "clspTuningDescInit": (_P(ClspTuningDesc), _u32),
    "clspTuningRun": (_void, _P(ClspTuningDesc), _P(_void)),
    "clspTuningRetain": (_void,),
    "clspTuningRelease": (_void,),
    "clspTuningGetJson": (_void, _u64, _P(_char), _P(_u64)),
    "clspTuningGetPath": (_void, _u64, _P(_char), _P(_u64)),
    "clspTuningExplain": (_void, _u32, _u32, _u64, _P(_char), _P(_u64)),
    "clspTuningGetRecordPath": (_void, _u64, _P(_char), _P(_u64)),
}

# The others: (return type, argument types).
OTHER_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "clspStatusString": (_text, (_i32,)),
    "clspDepthReasonString": (_text, (_u32,)),
    "clspDepthWarningString": (_text, (_u32,)),
}

STRUCTS: tuple[type[Structure], ...] = (
    ClspErrorInfo, ClspImage, ClspApertureDesc, ClspApertureInfo, ClspCaptureDesc, ClspCaptureSequence,
    ClspCaptureSequenceInfo, ClspDepthDesc, ClspDepthDot, ClspDepthPatternDot, ClspDepthSummary, ClspEffectParameter,
    ClspEffectInfo, ClspCameraTraits, ClspEffectSetting, ClspHypothesisFrame, ClspHypothesis, ClspDiagnoseDesc,
    ClspDiagnosisSummary, ClspDiagnosisRanked, ClspDiagnosisParameter, ClspDiagnosisPlace, ClspDiagnosisStep,
    ClspBeamProfile, ClspDoeDefects, ClspDoePatternDesc, ClspSpotPatternDesc, ClspDoePatternInfo, ClspDoeDesignOrder,
    ClspDoeDesignDesc, ClspDoeDesignReport, ClspDotLayoutDesc, ClspDotLayoutInfo, ClspDotsDesc, ClspInteropInfo,
    ClspLensDesc, ClspMaterial, ClspPatternDesc, ClspGeometry, ClspMotionDesc, ClspMotionInput, ClspMotionOutput,
    ClspFieldGrid, ClspPhaseDesc, ClspPhaseAdvance, ClspPhiloxDesc, ClspSensorDesc, ClspPipelineDesc, ClspFrame,
    ClspStageTiming, ClspProfileInfo, ClspProfileEffect, ClspProfileSequence, ClspProfileMap, ClspDeviceInfo,
    ClspContextDesc, ClspContextInfo, ClspMoments, ClspTuningSize, ClspTuningDesc,
)
