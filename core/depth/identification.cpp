#include "depth/identification.hpp"

#include "runtime/checks.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace clsp {
namespace {

constexpr std::size_t kNeighbours = 12;
constexpr double kSteepest = 2.75;       // slope of a surface against the image plane: 70 degrees
constexpr double kLargestGradient = 0.3; // px along the line per px between dots
constexpr double kSlack = 0.7;           // px along the line, for curvature and errors of centres
constexpr double kAgree = 0.6;           // probability that a neighbour lies on the same surface and was found
constexpr double kSpurious = 0.02;       // of dots that are not the pattern's
constexpr int kRounds = 3;               // of belief, the first without knowledge of the neighbours
constexpr std::uint64_t kMaxCandidates = 50000000;

struct Candidate {
    std::uint32_t dot;
    LinePlace place;
    double length; // pixels per unit of q
    double q_low, q_high;
    double belief;
};

// Dots by square cells of the image.
class Cells {
  public:
    Cells(const std::vector<DetectedDot> &dots, std::uint32_t width, std::uint32_t height, double side)
        : dots_(dots), side_(side), columns_(1 + static_cast<int>(width / side)),
          rows_(1 + static_cast<int>(height / side)), members_(std::size_t(columns_) * std::size_t(rows_)) {
        for (std::size_t i = 0; i < dots.size(); ++i)
            if (!(dots[i].flags & kDotFitFailed))
                members_[index(column(dots[i].x), row(dots[i].y))].push_back(static_cast<std::uint32_t>(i));
    }
    double side() const { return side_; }
    int column(double x) const { return clamped(x, columns_); }
    int row(double y) const { return clamped(y, rows_); }
    // Calls visit(dot) for those of the cells around (x, y), `reach` cells each way.
    template <typename Visit> void around(double x, double y, int reach, Visit visit) const {
        const int c = column(x), r = row(y);
        for (int v = std::max(r - reach, 0); v <= std::min(r + reach, rows_ - 1); ++v)
            for (int u = std::max(c - reach, 0); u <= std::min(c + reach, columns_ - 1); ++u)
                for (const std::uint32_t dot : members_[index(u, v)])
                    visit(dot);
    }

  private:
    std::size_t index(int u, int v) const { return std::size_t(v) * std::size_t(columns_) + std::size_t(u); }
    int clamped(double value, int count) const {
        return static_cast<int>(std::clamp(std::floor(value / side_), 0.0, double(count - 1)));
    }

    const std::vector<DetectedDot> &dots_;
    double side_;
    int columns_, rows_;
    std::vector<std::vector<std::uint32_t>> members_;
};

using Candidates = std::vector<std::vector<Candidate>>; // by detected dot

// Every pair of a detected dot and a line that passes it within the tolerance and the range of depth.
Candidates find_candidates(const std::vector<DetectedDot> &dots, const std::vector<EpipolarLine> &lines,
                           const IdentificationParameters &p, std::uint32_t width, std::uint32_t height) {
    const double widest = 4.0 * p.epipolar_tolerance_px;
    const Cells cells(dots, width, height, std::max(8.0, widest));
    Candidates candidates(dots.size());
    std::vector<std::uint32_t> seen(dots.size(), kNoDot);
    std::uint64_t total = 0;
    for (std::size_t j = 0; j < lines.size(); ++j) {
        const EpipolarLine &line = lines[j];
        if (!line.any())
            continue;
        const auto [from, to] = line.within(width, height, widest);
        if (from > to)
            continue;
        const double length = line.length();
        const int steps = 1 + static_cast<int>((to - from) * length / cells.side());
        for (int step = 0; step <= steps; ++step) {
            const double q = from + (to - from) * step / steps;
            cells.around(line.x0 + q * line.ax, line.y0 + q * line.ay, 1, [&](std::uint32_t i) {
                if (seen[i] == j)
                    return;
                seen[i] = static_cast<std::uint32_t>(j);
                const LinePlace place = place_on_line(line, dots[i].x, dots[i].y, dots[i].covariance);
                const double tolerance = std::min(p.epipolar_tolerance_px + 3.0 * place.error_sd, widest);
                const double slack = std::min(kSlack / length + 3.0 * place.q_sd, 3.0 / length);
                if (std::abs(place.error) > tolerance || place.q < line.q_low - slack ||
                    place.q > line.q_high + slack || !(place.q > 0.0))
                    return;
                candidates[i].push_back({static_cast<std::uint32_t>(j), place, length, line.q_low, line.q_high, 0.0});
                if (++total > kMaxCandidates)
                    throw Error(Status::kUnsupported,
                                fmt::format("more than {} pairs of a detected dot and a dot of the pattern; narrow the "
                                            "range from near_m to far_m or epipolar_tolerance_px",
                                            kMaxCandidates));
            });
        }
    }
    return candidates;
}

// The nearest detected dots of each, with their distances.
std::vector<std::vector<std::pair<double, std::uint32_t>>> find_neighbours(const std::vector<DetectedDot> &dots,
                                                                           std::uint32_t width, std::uint32_t height) {
    std::size_t usable = 0;
    for (const DetectedDot &dot : dots)
        usable += !(dot.flags & kDotFitFailed);
    const double spacing = std::sqrt(double(width) * height / double(std::max<std::size_t>(usable, 1)));
    const Cells cells(dots, width, height, std::max(4.0, 2.0 * spacing));
    std::vector<std::vector<std::pair<double, std::uint32_t>>> neighbours(dots.size());
    for (std::size_t i = 0; i < dots.size(); ++i) {
        if (dots[i].flags & kDotFitFailed)
            continue;
        auto &near = neighbours[i];
        cells.around(dots[i].x, dots[i].y, 1, [&](std::uint32_t other) {
            if (other != i)
                near.emplace_back(std::hypot(dots[other].x - dots[i].x, dots[other].y - dots[i].y), other);
        });
        std::sort(near.begin(), near.end());
        near.resize(std::min(near.size(), kNeighbours));
    }
    return neighbours;
}

// What a neighbour says for a candidate, as the logarithm of a likelihood ratio: does one of its own candidates lie on
// a surface through this one? How far their places on the lines may differ, in pixels, depends on no candidate's depth:
// in a pattern that repeats, each repetition then has the same to say for itself.
double testimony(const Candidate &candidate, const std::vector<Candidate> &others, double distance, double focal_length,
                 bool first_round) {
    if (others.empty())
        return 0.0;
    const double gradient = std::min(kSteepest * candidate.q_high * candidate.length / focal_length, kLargestGradient);
    const double allowed = (kSlack + gradient * distance) / candidate.length;
    double agreeing = 0.0;
    for (const Candidate &other : others)
        if (other.dot != candidate.dot && std::abs(other.place.q - candidate.place.q) <= allowed)
            agreeing += first_round ? 1.0 : other.belief;
    // By chance: another line's in that part of the range.
    const double one = std::min(0.5, 2.0 * allowed / (candidate.q_high - candidate.q_low));
    const double chance = first_round ? 1.0 - std::pow(1.0 - one, double(others.size())) : one;
    if (chance >= kAgree)
        return 0.0; // says nothing
    const double agree = std::min(agreeing, 1.0);
    return std::log(agree * kAgree / chance + (1.0 - agree) * (1.0 - kAgree) / (1.0 - chance));
}

} // namespace

std::vector<Identity> identify(const std::vector<DetectedDot> &dots, const std::vector<EpipolarLine> &lines,
                               const IdentificationParameters &p, double focal_length_px, std::uint32_t width,
                               std::uint32_t height) {
    Candidates candidates = find_candidates(dots, lines, p, width, height);
    const auto neighbours = find_neighbours(dots, width, height);
    std::vector<double> spurious(dots.size(), 1.0);
    for (int round = 0; round < kRounds; ++round) {
        std::vector<std::vector<double>> beliefs(dots.size()); // all from those of the round before
        for (std::size_t i = 0; i < dots.size(); ++i) {
            const auto &own = candidates[i];
            if (own.empty())
                continue;
            std::vector<double> scores;
            double best = std::log(kSpurious);
            const double background = best;
            for (const Candidate &candidate : own) {
                const double pull =
                    candidate.place.error / std::hypot(p.epipolar_tolerance_px / 3.0, candidate.place.error_sd);
                double score = std::log((1.0 - kSpurious) / double(own.size())) - 0.5 * pull * pull;
                for (const auto &[distance, other] : neighbours[i])
                    score += testimony(candidate, candidates[other], distance, focal_length_px, round == 0);
                scores.push_back(score);
                best = std::max(best, score);
            }
            double sum = std::exp(background - best);
            for (double &score : scores)
                sum += score = std::exp(score - best);
            for (double &score : scores)
                score /= sum;
            spurious[i] = std::exp(background - best) / sum;
            beliefs[i] = std::move(scores);
        }
        for (std::size_t i = 0; i < dots.size(); ++i)
            for (std::size_t c = 0; c < candidates[i].size(); ++c)
                candidates[i][c].belief = beliefs[i][c];
    }

    std::vector<Identity> identities(dots.size());
    struct Claim {
        std::uint32_t dot;
        double belief, error;
        std::size_t by;
    };
    std::vector<Claim> claims;
    for (std::size_t i = 0; i < dots.size(); ++i) {
        Identity &identity = identities[i];
        if (dots[i].flags & kDotFitFailed)
            continue;
        identity.candidates = static_cast<std::uint32_t>(candidates[i].size());
        if (candidates[i].empty()) {
            identity.reason = DepthReason::kNoCandidate;
            continue;
        }
        const Candidate &likeliest =
            *std::max_element(candidates[i].begin(), candidates[i].end(),
                              [](const Candidate &a, const Candidate &b) { return a.belief < b.belief; });
        identity.dot = likeliest.dot;
        identity.confidence = likeliest.belief;
        identity.place = likeliest.place;
        // Candidates may lie beyond the range by what speckle moves a dot, so that they vote; depths may not.
        const double beyond = std::max(likeliest.q_low - likeliest.place.q, likeliest.place.q - likeliest.q_high);
        if (likeliest.belief >= p.min_confidence && beyond > 3.0 * likeliest.place.q_sd) {
            identity.reason = DepthReason::kNoCandidate;
        } else if (likeliest.belief >= p.min_confidence) {
            identity.reason = DepthReason::kPlaced;
            claims.push_back({likeliest.dot, likeliest.belief, std::abs(likeliest.place.error), i});
        } else {
            identity.reason = spurious[i] > 0.5 ? DepthReason::kUnsupported : DepthReason::kAmbiguous;
        }
    }
    // One to one: the likelier, then the nearer to the line.
    std::sort(claims.begin(), claims.end(), [](const Claim &a, const Claim &b) {
        return std::tuple(a.dot, -a.belief, a.error, a.by) < std::tuple(b.dot, -b.belief, b.error, b.by);
    });
    for (std::size_t k = 1; k < claims.size(); ++k)
        if (claims[k].dot == claims[k - 1].dot)
            identities[claims[k].by].reason = DepthReason::kConflict;
    return identities;
}

} // namespace clsp
