// init(): a struct's defaults where it has some, else its size.
// Written by scripts/generate_bindings.py: do not edit.
// clang-format off
#ifndef CLSPECKLE_INIT_HPP
#define CLSPECKLE_INIT_HPP

#include <clspeckle/clspeckle.h>

namespace clspeckle {
void check(ClspStatus status); // in clspeckle.hpp
namespace detail {

inline void init(ClspErrorInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspApertureDesc &value) { check(clspApertureDescInit(&value, sizeof(value))); }
inline void init(ClspApertureInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspCaptureDesc &value) { check(clspCaptureDescInit(&value, sizeof(value))); }
inline void init(ClspCaptureSequence &value) { check(clspCaptureSequenceInit(&value, sizeof(value))); }
inline void init(ClspCaptureSequenceInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspDepthDesc &value) { check(clspDepthDescInit(&value, sizeof(value))); }
inline void init(ClspDepthSummary &value) { value.struct_size = sizeof(value); }
inline void init(ClspCameraTraits &value) { check(clspCameraTraitsInit(&value, sizeof(value))); }
inline void init(ClspHypothesisFrame &value) { value.struct_size = sizeof(value); }
inline void init(ClspHypothesis &value) { check(clspHypothesisInit(&value, sizeof(value))); }
inline void init(ClspDiagnoseDesc &value) { check(clspDiagnoseDescInit(&value, sizeof(value))); }
inline void init(ClspDiagnosisSummary &value) { value.struct_size = sizeof(value); }
inline void init(ClspDiagnosisRanked &value) { value.struct_size = sizeof(value); }
inline void init(ClspDiagnosisParameter &value) { value.struct_size = sizeof(value); }
inline void init(ClspDiagnosisPlace &value) { value.struct_size = sizeof(value); }
inline void init(ClspDiagnosisStep &value) { value.struct_size = sizeof(value); }
inline void init(ClspBeamProfile &value) { check(clspBeamProfileInit(&value, sizeof(value))); }
inline void init(ClspDoeDefects &value) { check(clspDoeDefectsInit(&value, sizeof(value))); }
inline void init(ClspDoePatternDesc &value) { check(clspDoePatternDescInit(&value, sizeof(value))); }
inline void init(ClspSpotPatternDesc &value) { check(clspSpotPatternDescInit(&value, sizeof(value))); }
inline void init(ClspDoePatternInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspDoeDesignDesc &value) { check(clspDoeDesignDescInit(&value, sizeof(value))); }
inline void init(ClspDoeDesignReport &value) { value.struct_size = sizeof(value); }
inline void init(ClspDotLayoutDesc &value) { check(clspDotLayoutDescInit(&value, sizeof(value))); }
inline void init(ClspDotLayoutInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspDotsDesc &value) { check(clspDotsDescInit(&value, sizeof(value))); }
inline void init(ClspInteropInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspLensDesc &value) { check(clspLensDescInit(&value, sizeof(value))); }
inline void init(ClspMaterial &value) { check(clspMaterialInit(&value, sizeof(value))); }
inline void init(ClspPatternDesc &value) { check(clspPatternDescInit(&value, sizeof(value))); }
inline void init(ClspGeometry &value) { check(clspGeometryInit(&value, sizeof(value))); }
inline void init(ClspMotionDesc &value) { check(clspMotionDescInit(&value, sizeof(value))); }
inline void init(ClspMotionInput &value) { check(clspMotionInputInit(&value, sizeof(value))); }
inline void init(ClspMotionOutput &value) { check(clspMotionOutputInit(&value, sizeof(value))); }
inline void init(ClspPhaseDesc &value) { check(clspPhaseDescInit(&value, sizeof(value))); }
inline void init(ClspPhaseAdvance &value) { check(clspPhaseAdvanceInit(&value, sizeof(value))); }
inline void init(ClspPhiloxDesc &value) { check(clspPhiloxDescInit(&value, sizeof(value))); }
inline void init(ClspSensorDesc &value) { check(clspSensorDescInit(&value, sizeof(value))); }
inline void init(ClspPipelineDesc &value) { check(clspPipelineDescInit(&value, sizeof(value))); }
inline void init(ClspFrame &value) { check(clspFrameInit(&value, sizeof(value))); }
inline void init(ClspProfileInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspProfileEffect &value) { value.struct_size = sizeof(value); }
inline void init(ClspProfileSequence &value) { value.struct_size = sizeof(value); }
inline void init(ClspProfileMap &value) { value.struct_size = sizeof(value); }
inline void init(ClspDeviceInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspContextDesc &value) { check(clspContextDescInit(&value, sizeof(value))); }
inline void init(ClspContextInfo &value) { value.struct_size = sizeof(value); }
inline void init(ClspMoments &value) { value.struct_size = sizeof(value); }
inline void init(ClspTuningDesc &value) { check(clspTuningDescInit(&value, sizeof(value))); }

} // namespace detail
} // namespace clspeckle

#endif
