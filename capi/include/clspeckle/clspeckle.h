/**
 * @file clspeckle.h
 * @brief The whole C interface of clSpeckle. See types.h for the conventions that hold throughout.
 */
#ifndef CLSPECKLE_H
#define CLSPECKLE_H

#include "aperture.h"
#include "capture.h"
#include "depth.h"
#include "diagnosis.h"
#include "doe.h"
#include "doe_design.h"
#include "dot_layout.h"
#include "dots.h"
#include "effects.h"
#include "interop.h"
#include "lens.h"
#include "material.h"
#include "motion.h"
#include "pattern.h"
#include "phase.h"
#include "philox.h"
#include "pipeline.h"
#include "profile.h"
#include "runtime.h"
#include "sensor.h"
#include "statistics.h"
#include "tuning.h"
#include "types.h"

#endif /* CLSPECKLE_H */
