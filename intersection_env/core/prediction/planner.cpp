#include "intersection_env/planner.hpp"

#include <stdexcept>
#include <utility>

#include "kernel/dispatch.hpp"
#include "prediction/carry.hpp"
#include "prediction/predictor.hpp"

namespace intersection_env {
namespace {

int route_named(const Map& map, const std::string& id) {
    std::string known;
    for (std::size_t r = 0; r < map.routes.size(); ++r) {
        if (map.routes[r].id == id) {
            return static_cast<int>(r);
        }
        known += (r == 0 ? "" : ", ") + map.routes[r].id;
    }
    throw std::invalid_argument(map.name + " has no route \"" + id + "\"; its routes are " + known);
}

std::size_t scenarios_in(std::span<const std::int8_t> priorities, std::size_t pairs) {
    if (priorities.empty()) {
        return 1;
    }
    if (pairs == 0 || priorities.size() % pairs != 0) {
        throw std::invalid_argument("priorities must be (scenario, " + std::to_string(pairs) + "), not " +
                                    std::to_string(priorities.size()) + " numbers");
    }
    for (const std::int8_t way : priorities) {
        if (way < -1 || way > 1) {
            throw std::invalid_argument("priorities must be +1 (yielder first), -1 (prioritized first) or 0");
        }
    }
    return priorities.size() / pairs;
}

std::size_t frame_of(const Prediction& prediction, int step, int scenario) {
    if (step < 0 || step > STEPS || scenario < 0 || scenario >= prediction.scenarios) {
        throw std::invalid_argument("no step " + std::to_string(step) + " of scenario " + std::to_string(scenario) +
                                    " in a prediction of " + std::to_string(prediction.scenarios) + " scenarios and " +
                                    std::to_string(STEPS) + " steps");
    }
    return (static_cast<std::size_t>(scenario) * (STEPS + 1) + static_cast<std::size_t>(step)) *
           static_cast<std::size_t>(prediction.vehicles);
}

// The indices of those present.
std::vector<int> present_at(const Prediction& prediction, int step, int scenario) {
    const std::size_t first = frame_of(prediction, step, scenario);
    std::vector<int> vehicles;
    for (int i = 0; i < prediction.vehicles; ++i) {
        if (prediction.present[first + static_cast<std::size_t>(i)] != 0) {
            vehicles.push_back(i);
        }
    }
    return vehicles;
}

} // namespace

Traffic traffic_of(const Map& map, std::span<const Vehicle> vehicles) {
    Traffic traffic;
    for (const Vehicle& vehicle : vehicles) {
        traffic.route.push_back(route_named(map, vehicle.route));
        traffic.position.push_back(vehicle.position);
        traffic.speed.push_back(vehicle.speed);
        traffic.length.push_back(vehicle.length);
        traffic.width.push_back(vehicle.width);
        traffic.max_speed.push_back(vehicle.max_speed);
    }
    check(map, traffic);
    return traffic;
}

Planner::Planner(Map map, Policy policy, int threads, std::optional<Patience> patience)
    : predictor_(std::make_shared<const Predictor>(std::make_shared<const Map>(std::move(map)), std::move(policy),
                                                   threads, patience)) {}

const Map& Planner::map() const { return predictor_->map(); }
const Policy& Planner::policy() const { return predictor_->policy(); }

Prediction Planner::predict(const Traffic& traffic, std::span<const std::int8_t> priorities) const {
    Prediction result;
    predict(traffic, priorities, result);
    return result;
}

void Planner::predict(const Traffic& traffic, std::span<const std::int8_t> priorities, Prediction& result) const {
    check(map(), traffic);
    find_conflicts(map(), traffic, result.pairs);
    const std::size_t vehicles = traffic.route.size(), scenarios = scenarios_in(priorities, result.pairs.size());
    result.scenarios = static_cast<int>(scenarios);
    result.vehicles = traffic.count();
    result.traffic = traffic;
    result.priorities.assign(priorities.begin(), priorities.end());
    result.priorities.resize(scenarios * result.pairs.size());
    for (auto* values : {&result.position, &result.speed, &result.acceleration}) {
        values->resize(scenarios * (STEPS + 1) * vehicles);
    }
    result.enters.resize(result.position.size());
    result.present.resize(result.position.size());
    result.hold.resize(result.position.size());
    result.waited.resize(map().has_stops() ? result.position.size() : 0);
    result.time_loss.resize(scenarios * vehicles);
    result.minimum_distance.resize(scenarios);
    result.patience.resize(predictor_->keeps_patience(traffic) ? vehicles : 0);
    predictor_->predict(
        traffic, result.priorities, result.scenarios, {},
        {{result.position.data(), result.speed.data(), result.acceleration.data(), result.enters.data(),
          result.present.data(), result.hold.data(), result.waited.empty() ? nullptr : result.waited.data()},
         result.time_loss.data(),
         result.minimum_distance.data(),
         nullptr,
         result.patience.empty() ? nullptr : result.patience.data()},
        kernel());
}

Traffic Planner::traffic_at(const Prediction& prediction, int step, int scenario) const {
    const std::size_t frame = frame_of(prediction, step, scenario);
    const std::size_t before = frame - (step > 0 ? static_cast<std::size_t>(prediction.vehicles) : 0);
    const Traffic& start = prediction.traffic;
    Traffic now;
    for (const int vehicle : present_at(prediction, step, scenario)) {
        const auto i = static_cast<std::size_t>(vehicle);
        now.route.push_back(start.route[i]);
        now.position.push_back(prediction.position[frame + i]);
        now.speed.push_back(prediction.speed[frame + i]);
        now.length.push_back(start.length[i]);
        now.width.push_back(start.width[i]);
        now.max_speed.push_back(start.max_speed[i]);
        if (step > 0) { // what was decided at the step before
            now.delta.push_back(prediction.enters[before + i]);
            now.hold.push_back(prediction.hold[before + i]);
            if (!prediction.waited.empty()) {
                now.waited.push_back(prediction.waited[before + i]);
            }
        } else if (start.has_memories()) {
            now.delta.push_back(start.delta[i]);
            now.hold.push_back(start.hold[i]);
            if (!start.waited.empty()) {
                now.waited.push_back(start.waited[i]);
            }
        }
        if (!prediction.patience.empty()) {
            now.patience.push_back(prediction.patience[i]);
        }
    }
    return now;
}

std::vector<std::int8_t> Planner::priorities_at(const Prediction& prediction, int step, int scenario) const {
    const Traffic later = traffic_at(prediction, step, scenario);
    const std::span<const std::int8_t> all = prediction.priorities;
    const std::size_t pairs = prediction.pairs.size();
    return carry_priorities(map(), prediction.pairs, all.subspan(static_cast<std::size_t>(scenario) * pairs, pairs),
                            present_at(prediction, step, scenario), later);
}

std::vector<float> Planner::patience(const Traffic& traffic, std::span<const double> levels) const {
    return predictor_->patience(traffic, levels, kernel());
}

Forecast Planner::forecast(const Traffic& traffic, std::span<const std::int8_t> given,
                           const ForecastLimits& limits) const {
    Forecast result;
    result.likely = order_probabilities(*predictor_, traffic, given, limits, kernel());
    predict(traffic, result.likely.orders, result.prediction);
    return result;
}

std::vector<float> Planner::position_quantiles(const Forecast& forecast, std::span<const double> levels) const {
    if (!policy().forecast) {
        throw std::invalid_argument("the policy holds no spread, so it knows no quantiles");
    }
    return intersection_env::position_quantiles(policy().forecast->spread, forecast.likely.probability,
                                                forecast.prediction.position.data(), forecast.prediction.vehicles,
                                                levels);
}

Ranking Planner::rank(const Traffic& traffic, std::span<const std::uint8_t> cooperative, const Budget& budget,
                      std::optional<RankBy> by) const {
    const std::vector<std::uint8_t> all(cooperative.empty() ? traffic.route.size() : 0, 1);
    return rank_maneuvers(*predictor_, traffic, cooperative.empty() ? all : cooperative, budget, by, kernel());
}

} // namespace intersection_env
