// Maneuvers: every crossing order of a traffic predicted, and ranked by the time that it saves, or is expected to save.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "intersection_env/map.hpp"
#include "intersection_env/orders.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

class Predictor;
struct Kernel;

constexpr double WORTHWHILE_GAIN =
    2.0; // [s], paper, Section IV-C.3: a gain beyond the error of the predicted time loss

// What a maneuver is ranked by: what is predicted under it where all else is left to the gap decision; or what is
// expected over the orders that its vehicles and all others may find, each with its probability, as is what happens
// without intervention.
enum class RankBy : std::uint8_t { prediction, expectation };

// One crossing order imposed on the vehicles, or no intervention. Time losses over 10 s [s]. By expectation they are
// means, `minimum_distance` and `followed` are those of the most probable order, and the chances say how sure it is;
// by prediction each chance is 0 or 1.
struct Maneuver {
    double total_time_loss;   // of all vehicles
    double worst_time_loss;   // of any vehicle
    double gain;              // in total time loss against no intervention
    double chance_worthwhile; // that it gains more than WORTHWHILE_GAIN
    double chance_unsafe;     // that it is not followed, or bodies come nearer than 0.5 m
    float minimum_distance;   // [m], infinite where no two vehicles can touch
    bool followed;            // in its own prediction, whoever it puts second lets the first pass
    bool safe;                // followed, and at least 0.5 m
    bool worth_executing;     // safe, and gains more than WORTHWHILE_GAIN
    bool intervention;        // false for no intervention
};

// The maneuvers: safe ones, then unsafe ones, last those that are not followed; each by total time loss, equal ones as
// the search found them.
struct Ranking {
    std::vector<Pair> pairs; // find_conflicts of the traffic
    std::vector<Maneuver> maneuvers;
    std::vector<std::int8_t> priorities; // (maneuver, pair): +1 yielder first, -1 prioritized first, 0 gap decision
    std::size_t left_out = 0;            // orders beyond the budget, of those never found at most MOST_COUNTED counted

    std::span<const std::int8_t> priorities_of(std::size_t maneuver) const {
        return {priorities.data() + maneuver * pairs.size(), pairs.size()};
    }
};

// Predicts no intervention and as many crossing orders as the budget has; one batch of them at least. By prediction
// they begin with those that keep the order of no intervention among most pairs; by expectation with the most probable
// one, and the least certain pairs change first. cooperative: one flag a vehicle, as in Orders. by: expectation where
// the policy has a forecast model, if none is named. Throws std::invalid_argument for a traffic that is refused, too
// few flags, or an expectation without such a model.
Ranking rank_maneuvers(const Predictor& predictor, const Traffic& traffic, std::span<const std::uint8_t> cooperative,
                       const Budget& budget, std::optional<RankBy> by, const Kernel& kernel);

// Who reached each conflict first in predicted trajectories, position (scenario, STEPS + 1, vehicle): (scenario, pair),
// +1 the yielder, -1 the prioritized vehicle or both within one step (ours), 0 neither yet. A vehicle reaches a
// conflict when its front bumper is where the other route's swept area begins.
std::vector<std::int8_t> crossing_order(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                                        const float* position, std::size_t scenarios);

// Orders (order, pair) as sequences of vehicles, "a, b, c": each before those that follow. Among vehicles that need not
// wait for each other, the one nearer to its stop line comes first. names: (vehicle,).
std::vector<std::string> in_words(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                                  std::span<const std::string> names, const std::int8_t* orders, std::size_t count);

} // namespace intersection_env
