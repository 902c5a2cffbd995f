/**
 * @file exposure_range.hpp
 * @brief What of a sensor's codes light can use.
 */
#ifndef CLSPECKLE_TOOLS_EXPOSURE_RANGE_HPP
#define CLSPECKLE_TOOLS_EXPOSURE_RANGE_HPP

#include "options.hpp"

#include <string>

namespace tools {

/** Of a camera with its effects; in dn. */
class ExposureRange {
  public:
    /**
     * @param has_sensor without one there are no codes, and no effects on them.
     * @param dark_dn mean of the dark frame.
     */
    ExposureRange(const Config &config, bool has_sensor, double dark_dn);

    double top_code() const { return top_code_; }
    double ambient_light() const { return ambient_light_; }
    /** The largest signal of a pixel; infinite: only the converter ends it. */
    double largest_signal() const { return largest_signal_; }
    /** The converter's own largest code. */
    double largest_code() const { return largest_code_; }
    /** The code of a pixel without light. */
    double offset() const { return offset_; }
    bool ends_below_top() const { return has_sensor_ && offset_ + largest_signal_ < largest_code_; }
    /** What the black level, the dark frame and ambient light leave of the range. */
    double room() const;
    std::string why_no_room() const;
    /** That --exposure-gain auto aims at: half of full scale, or of what a high black level and ambient light leave. */
    double auto_signal() const;
    /** A code that pixels at their end have: the top one, or what the noise leaves of the largest signal. */
    double last_code() const;

  private:
    bool has_sensor_;
    double black_level_, read_noise_, offset_;
    double top_code_, largest_code_, largest_signal_, ambient_light_;
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_EXPOSURE_RANGE_HPP
