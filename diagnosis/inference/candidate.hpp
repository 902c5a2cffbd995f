// The effects that may be the cause of a gap: the catalogue's and the user's hypotheses, under one description.
#pragma once

#include "simulator/simulator.hpp"
#include "statistics/quantities.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace clsp {

struct Candidate {
    std::string id, stage, summary;
    std::vector<HypothesisParameter> parameters;
    // Above 0: another form of the effect, by its number, whose change is nearly that of the catalogue's own. Screening
    // does not tell which of them it is, fits do.
    std::size_t form = 0;

    // A parameter's value at its own strength, from weak (0) to strong (1) and beyond, within the accepted range.
    // sign -1, of an effect that has a direction, here and below: the other one, where the first parameter is below
    // zero, or one over what it is.
    double value(std::size_t parameter, double strength, double sign = 1.0) const;
    // The strength at which a parameter has a value.
    double strength(std::size_t parameter, double value, double sign = 1.0) const;
    // Where a parameter's strengths begin.
    double weakest(std::size_t parameter) const;
    // The strength of the value that a strength stands for: within the parameter's range, and of a whole number where
    // it is one.
    double snapped(std::size_t parameter, double strength, double sign = 1.0) const;
    // A search moves it with the others from weak to strong: what the catalogue varies; of an effect of which it varies
    // nothing, the first.
    bool is_varied(std::size_t parameter) const;
    // One of several forms of the effect, by their number: no fit goes from one to another, each is a candidate
    // (with_alternatives). Or one that was measured.
    bool is_choice(std::size_t parameter) const {
        return (parameters[parameter].whole || parameters[parameter].measured) && !is_varied(parameter);
    }
    // A value far below the catalogue's weakest, of the first parameter that it varies, which says how strong an effect
    // is.
    bool is_slight(std::size_t parameter, double value) const;
    // The value that the catalogue has, of a parameter that it does not vary, in a direction.
    double usual(std::size_t parameter, double sign) const {
        return mirrored(parameters[parameter].weak, sign, parameter);
    }
    // Strengths to screen at, one after the other until one changes something: an effect may do nothing half way
    // from weak to strong.
    static constexpr double kScreeningStrengths[] = {0.5, 1.0, 0.0};
    // The direction in which a value of the first parameter lies.
    double sign_of(double value) const;
    // How far to go from a strength for a finite difference.
    double difference(std::size_t parameter, double strength, double sign = 1.0) const;
    // It goes the other way, too.
    bool has_direction() const { return direction() != Direction::kNone; }
    // Whether a value counts from 1.
    bool is_ratio(std::size_t parameter) const { return parameter == 0 && direction() == Direction::kRatio; }

  private:
    // From 0 where the first parameter's range lies on both sides of it, weak and strong on one; from 1 where its range
    // is the same for a value and for one over it.
    enum class Direction { kNone, kSign, kRatio };
    Direction direction() const;
    bool is_mirrored(double sign, std::size_t parameter, Direction direction) const {
        return sign < 0.0 && parameter == 0 && this->direction() == direction;
    }
    // A value within the range, of what mirrored() gives.
    double clamped(std::size_t parameter, double strength, double sign) const;
    // The value in the other direction, in either of them.
    double mirrored(double value, double sign, std::size_t parameter) const;
    // A parameter as it is in a direction: the range of what mirrored() gives.
    HypothesisParameter towards(double sign, std::size_t parameter) const;
};

// Throws kInvalidArgument for ids in `without` that neither the catalogue nor the hypotheses have.
std::vector<Candidate> candidates(const std::vector<Hypothesis> &hypotheses, const std::vector<std::string> &without);
// The catalogue's ranges are those of a converter of ten bits and 4 DN of read noise. On another camera levels go with
// the converter's range, noise in DN with the data sheet's read noise (the dark frames' where that is more than twice
// it), and the converter's own bits with those that are lost. A user's hypotheses stay as they are.
void scale_to_camera(std::vector<Candidate> &candidates, const CaptureLayout &camera, double dark_noise_dn);
// Parameters that quantities tell are those of the first sequence that does; an effect of which none does is not there.
void hold_at_quantities(std::vector<Candidate> &candidates, const std::vector<Quantity> &quantities);
// And again those that a fit cannot reach from where the catalogue has them, elsewhere: the same id, another usual
// value.
std::vector<Candidate> with_alternatives(std::vector<Candidate> candidates);
// An order of candidates that are all different.
bool before(const Candidate &a, const Candidate &b);
// The first of each id, in their order. id_of: of an entry.
template <typename Entry, typename IdOf> void keep_one_of_each(std::vector<Entry> &entries, const IdOf &id_of) {
    std::vector<Entry> kept;
    for (Entry &entry : entries)
        if (std::none_of(kept.begin(), kept.end(), [&](const Entry &other) { return id_of(other) == id_of(entry); }))
            kept.push_back(std::move(entry));
    entries = std::move(kept);
}

} // namespace clsp
