#include "inference/gauss_newton.hpp"

#include "inference/least_squares.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <utility>

namespace clsp {
namespace {

// Broyden's update: the matrix nearest to the last one that tells what a step did.
void update_secant(Eigen::MatrixXd &jacobian, const Eigen::VectorXd &moved, const Eigen::VectorXd &changed) {
    const double square = moved.squaredNorm();
    if (square > 0.0)
        jacobian += (changed - jacobian * moved) * moved.transpose() / square;
}

} // namespace

std::vector<bool> concerned_sequences(ReplicateRunner &runner, const std::string &id) {
    std::vector<bool> result;
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s)
        result.push_back(runner.simulator().concerns(id, s));
    return result;
}

Eigen::VectorXd slope(ReplicateRunner &runner, const EffectModel &model, Eigen::Index p, const Pool &pool,
                      const GaussNewtonOptions &options) {
    EffectModel moved = model;
    const double step = move_one(moved, p, options.part);
    return simulate_change(runner, pool, moved.settings(), concerned_sequences(runner, model.id_of(p)), options.seed,
                           options.seeds)
               .mean /
           step;
}

GaussNewtonFit gauss_newton(ReplicateRunner &runner, EffectModel model, const Origin &origin,
                            const std::vector<Eigen::VectorXd> &known, const GaussNewtonOptions &options,
                            const std::function<void(Eigen::Index)> &report) {
    const Eigen::Index parameters = static_cast<Eigen::Index>(model.strengths.size());
    // But for what stays.
    bool all_fresh = true;
    for (std::size_t p = 0; p < known.size(); ++p)
        all_fresh = all_fresh && (known[p].size() == 0 || model.strengths[p].held);
    const Eigen::VectorXd target_of_origin =
        runner.real().mean() - origin.covariance.mean() + origin.pool.mean(options.seeds);
    GaussNewtonFit best;
    Eigen::VectorXd best_mean, step;
    int idle = 0;
    // The linear step from the best model, and the squared distance that it should leave.
    const auto solve = [&](GaussNewtonFit &fit, const Eigen::VectorXd &mean) {
        const Eigen::VectorXd target = origin.covariance.whiten(target_of_origin - mean);
        const Eigen::MatrixXd columns = whiten_columns(origin.covariance, fit.jacobian);
        std::vector<Eigen::Index> free; // what is held stays
        for (Eigen::Index p = 0; p < parameters; ++p)
            if (!fit.model.strengths[static_cast<std::size_t>(p)].held)
                free.push_back(p);
        std::vector<Eigen::Index> stopped;
        do {
            step = Eigen::VectorXd::Zero(parameters);
            if (!free.empty())
                step(free) = solve_least_squares(columns(Eigen::all, free), target);
            // The others make up for what stays.
            stopped = stop_where_nothing_shows(fit.model.strengths, columns, step);
            free.erase(std::remove_if(free.begin(), free.end(),
                                      [&](Eigen::Index p) {
                                          return std::find(stopped.begin(), stopped.end(), p) != stopped.end();
                                      }),
                       free.end());
        } while (!stopped.empty());
        fit.square = (target - columns * step).squaredNorm();
    };
    for (int round = 0; round < options.rounds + options.secant_rounds; ++round) {
        GaussNewtonFit now;
        now.model = model;
        now.pool = simulate_pool(runner, model.settings(), options.seed, options.seeds);
        const Eigen::VectorXd mean = now.pool.mean(options.seeds);
        now.jacobian.resize(mean.size(), parameters);
        const bool secant = round >= options.rounds;
        if (secant) {
            now.jacobian = best.jacobian;
            update_secant(now.jacobian, model.distance_from(best.model), mean - best_mean);
        } else {
            std::vector<Eigen::Index> unknown;
            for (Eigen::Index p = 0; p < parameters; ++p) {
                const std::size_t k = static_cast<std::size_t>(p);
                // What stays has the slope that it had.
                if ((round == 0 || model.strengths[k].held) && k < known.size() && known[k].size())
                    now.jacobian.col(p) = known[k];
                else
                    unknown.push_back(p);
            }
            runner.side_by_side(unknown.size(), [&](ReplicateRunner &own, std::size_t i) {
                if (report && own.on_callers_thread())
                    report(unknown[i]);
                now.jacobian.col(unknown[i]) = slope(own, model, unknown[i], now.pool, options);
            });
        }
        solve(now, mean);
        idle = now.square > (1.0 - options.least_gain) * best.square ? idle + 1 : 0;
        if (now.square > (secant ? 1.0 : kFit.much_worse) * best.square) {
            // A step too far: what it told goes into the next one.
            if (!secant)
                update_secant(now.jacobian = best.jacobian, model.distance_from(best.model), mean - best_mean);
            best.jacobian = std::move(now.jacobian);
            const double square = best.square;
            solve(best, best_mean);
            best.square = square;
        } else {
            best = std::move(now);
            best_mean = mean;
        }
        if ((round >= kFit.patience && best.square > options.give_up_square) ||
            (options.least_gain > 0.0 && idle == kFit.idle_rounds))
            break;
        model = best.model;
        const double moved = move_strengths(model, step, options.strongest);
        const bool near = moved < options.near && (all_fresh || round > 0);
        const bool near_enough = round + 1 >= options.rounds && moved < options.far;
        if (near || near_enough || model.distance_from(best.model).squaredNorm() == 0.0)
            break;
    }
    return best;
}

} // namespace clsp
