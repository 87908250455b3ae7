// What a planner needs: bound once to an intersection and to who drives there, it predicts and ranks traffic.
//
//     const Planner planner(Map::read("bendplatz.map"), Policy::read("gap.policy"));
//     const Traffic traffic = traffic_of(planner.map(), {{{"SE-NW", 95.0F, 12.0F}, {"NE-SW", 80.0F, 3.0F}}});
//     const Ranking ranking = planner.rank(traffic);                                   // best safe order first
//     const Prediction best = planner.predict(traffic, ranking.priorities_of(0));      // its trajectories
//     const Forecast forecast = planner.forecast(traffic);                             // what happens without
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "intersection_env/forecast.hpp"
#include "intersection_env/format_error.hpp"
#include "intersection_env/locate.hpp"
#include "intersection_env/maneuvers.hpp"
#include "intersection_env/map.hpp"
#include "intersection_env/orders.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

// One vehicle, by its route's id.
struct Vehicle {
    std::string route;                                        // "SE-NW"
    float position;                                           // arc length of the vehicle's centre along its route [m]
    float speed;                                              // [m/s]
    float length = 4.5F;                                      // [m]
    float width = 1.8F;                                       // [m]
    float max_speed = std::numeric_limits<float>::infinity(); // its own top speed [m/s]; bicycles: 5
};

// The traffic of vehicles, in their order; `overlaps` says whose bodies overlap. Throws std::invalid_argument for an
// unknown route or a value out of range.
Traffic traffic_of(const Map& map, std::span<const Vehicle> vehicles);

// The next 10 s. Frames are DT apart, the first is now.
struct Prediction {
    int scenarios = 0, vehicles = 0;
    std::vector<Pair> pairs;                   // find_conflicts of the traffic
    std::vector<std::int8_t> priorities;       // (scenario, pair): those asked for, and what they imply
    std::vector<float> position, speed;        // (scenario, STEPS + 1, vehicle) [m], [m/s], along each one's own route
    std::vector<float> acceleration;           // likewise [m/s²], over the step that begins there; the last repeats
    std::vector<std::uint8_t> enters, present; // likewise: the gap decision; not yet at its route's end
    std::vector<float> time_loss;              // (scenario, vehicle) [s]
    std::vector<float> minimum_distance;       // (scenario,) [m], infinite where no two vehicles can touch
    std::vector<std::int16_t> hold;            // (scenario, STEPS + 1, vehicle): whom it lets go, as in Traffic
    std::vector<std::int32_t> waited;          // likewise: since its stop; empty where the map has none
    Traffic traffic;                           // what was predicted
    std::vector<float> patience;               // (vehicle,) what drivers keep, as in Traffic; empty: nothing
};

// The most probable crossing orders of the next 10 s, and the prediction of each: scenario k is order k.
struct Forecast {
    OrderProbabilities likely;
    Prediction prediction;
};

// Never changes once it is made: threads may share one and call it at the same time.
class Planner {
  public:
    // threads: how many share a batch of many scenarios, 0: one a core; they do not change what comes out. They help
    // one caller at a time; whoever calls meanwhile works alone.
    // patience: whether drivers keep the quantile by which they accept gaps; none named: DEFAULT_PATIENCE where a
    // network decides. Throws std::invalid_argument for a count out of range, or patience kept where no network
    // decides.
    Planner(Map map, Policy policy, int threads = 1, std::optional<Patience> patience = {});

    const Map& map() const;
    const Policy& policy() const;

    // priorities: (scenario, pair) over find_conflicts(map(), traffic): +1 yielder first, -1 prioritized first, 0 left
    // to the gap decision; what they imply under the lane order is added. Empty: one scenario, no intervention.
    // Throws std::invalid_argument for a traffic or priorities that are refused.
    Prediction predict(const Traffic& traffic, std::span<const std::int8_t> priorities = {}) const;
    // The same into memory that is there: from the second cycle on nothing is allocated, unless there are more
    // vehicles, pairs or scenarios than before.
    void predict(const Traffic& traffic, std::span<const std::int8_t> priorities, Prediction& result) const;

    // The traffic at a step, 0 to STEPS, of a predicted scenario: the vehicles then present, in their order, with what
    // they remember. Predicted on, it goes on as the prediction does, and keeps to its order with priorities_at:
    // (pair,) over find_conflicts of that traffic. Throws std::invalid_argument for a step or scenario that the
    // prediction does not have, and priorities_at where vehicles of one lane have passed through each other, so that
    // their order cannot be kept to.
    Traffic traffic_at(const Prediction& prediction, int step, int scenario = 0) const;
    std::vector<std::int8_t> priorities_at(const Prediction& prediction, int step, int scenario = 0) const;

    // The patience (vehicle,), as a traffic may hold it, of the driver at each vehicle's level of all that could be in
    // it; levels: (vehicle,) above 0 and below 1, 0.5 is the median. Throws std::invalid_argument where no network
    // decides about gaps, or for a level out of range.
    std::vector<float> patience(const Traffic& traffic, std::span<const double> levels) const;

    // given: orders that are sure, as a maneuver imposes them; otherwise as order_probabilities.
    Forecast forecast(const Traffic& traffic, std::span<const std::int8_t> given = {},
                      const ForecastLimits& limits = {}) const;
    // (level, STEPS + 1, vehicle) [m], as the function of this name.
    std::vector<float> position_quantiles(const Forecast& forecast, std::span<const double> levels) const;

    // cooperative: one flag a vehicle; only pairs of two that take instructions are ordered. Empty: all do.
    // Otherwise as rank_maneuvers.
    Ranking rank(const Traffic& traffic, std::span<const std::uint8_t> cooperative = {}, const Budget& budget = {},
                 std::optional<RankBy> by = {}) const;

  private:
    std::shared_ptr<const Predictor> predictor_;
};

} // namespace intersection_env
