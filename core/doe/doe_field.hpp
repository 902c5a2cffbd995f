// The device's part of a diffractive element's pattern: the manufactured design, fields behind it, and their light in
// texels.
#pragma once

#include "doe/beam_profile.hpp"
#include "doe/doe_element.hpp"
#include "fft/fft.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/device_buffer.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

// What an evaluation leaves: the share of the power in each texel, and in ORDERS the power of each bin of the cell's
// transform.
struct DoeLight {
    std::vector<float> texel_shares;
    std::vector<double>
        order_power; // sampled_height x sampled_width of line 0 .. (ORDERS: summed over lines with their shares)
    std::uint64_t device_memory_bytes = 0;
};

// Parts of spots that ORDERS adds to texels, of one line.
double spot_sums(const DoeElement &element, const SpotShape &spot);

// Works on one element with a queue of its own. Everything blocks.
class DoeField {
  public:
    // Throws kOutOfMemory, naming the need, if it does not fit; before any memory is taken.
    DoeField(std::shared_ptr<Context> context, const DoeElement &element, const BeamProfile &beam);

    // dot_power: for each line, and each wanted dot, its power in ORDERS.
    DoeLight evaluate(const SpotShape &spot);

  private:
    void plan_memory();
    void make_design();
    void add_line_orders(std::size_t number, const SpotShape &spot, DoeLight &light);
    void add_line_aperture(std::size_t number);
    // part: of laser line `number`
    void tell(std::size_t number, double part) const;
    void enqueue_field(CommandChain &chain, double wavelength_m, float shift_x, float shift_y);
    template <typename T> void read(const DeviceBuffer &buffer, std::vector<T> &values);

    std::shared_ptr<Context> context_;
    const DoeElement &element_;
    const BeamProfile &beam_;
    cl::CommandQueue queue_;
    std::uint32_t columns_ = 0, rows_ = 0; // of the transform
    double beam_norm_ = 1;                 // sum of the squared amplitudes over the aperture
    std::uint64_t memory_bytes_ = 0;
    std::shared_ptr<Fft> fft_;
    DeviceBuffer design_, field_, scratch_, power_, texels_, beam_table_, spot_table_;
};

} // namespace clsp
