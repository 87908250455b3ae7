#include <algorithm>

#include "intersection_env/orders.hpp"
#include "model/contact.hpp"
#include "prediction/ranked.hpp"

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

Maneuver maneuver(const Outcomes& outcomes, std::size_t order, std::size_t vehicles, const Maneuver* none) {
    Maneuver result{};
    for (std::size_t i = 0; i < vehicles; ++i) {
        const double lost = outcomes.time_loss[order * vehicles + i];
        result.total_time_loss += lost;
        result.worst_time_loss = std::max(result.worst_time_loss, lost);
    }
    result.minimum_distance = outcomes.minimum_distance[order];
    result.followed = outcomes.followed[order] != 0;
    result.safe = outcomes.safe(order);
    result.intervention = none != nullptr;
    result.gain = none == nullptr ? 0.0 : none->total_time_loss - result.total_time_loss;
    result.worth_executing = result.safe && result.gain > WORTHWHILE_GAIN;
    result.chance_worthwhile = result.gain > WORTHWHILE_GAIN ? 1.0 : 0.0;
    result.chance_unsafe = result.safe ? 0.0 : 1.0;
    return result;
}

} // namespace

bool imposes_anything(std::span<const std::int8_t> priorities) {
    return std::ranges::any_of(priorities, [](std::int8_t direction) { return direction != 0; });
}

bool Outcomes::safe(std::size_t order) const {
    return followed[order] != 0 && minimum_distance[order] >= COLLISION_DISTANCE;
}

Outcomes outcomes_of(const Predictor& predictor, const Traffic& traffic, std::span<const std::int8_t> orders,
                     std::size_t count, const Trajectories& trajectories, const Kernel& kernel) {
    Outcomes found;
    found.time_loss.resize(count * at(traffic.count()));
    found.minimum_distance.resize(count);
    found.followed.resize(count);
    std::vector<std::int8_t> completed(orders.begin(), orders.end());
    predictor.predict(traffic, completed, static_cast<int>(count), {},
                      {trajectories, found.time_loss.data(), found.minimum_distance.data(), found.followed.data()},
                      kernel);
    return found;
}

Ranking predicted_maneuvers(const Predictor& predictor, const Traffic& traffic,
                            std::span<const std::uint8_t> cooperative, std::size_t limit, const Deadline& deadline,
                            const Kernel& kernel) {
    const Map& map = predictor.map();
    const std::size_t vehicles = at(traffic.count());
    Ranking ranking;
    ranking.pairs = find_conflicts(map, traffic);
    const std::size_t pairs = ranking.pairs.size(), frames = at(STEPS + 1) * vehicles;
    const auto append = [&](std::span<const std::int8_t> orders, std::size_t count, const Trajectories& trajectories) {
        const Outcomes outcomes = outcomes_of(predictor, traffic, orders, count, trajectories, kernel);
        ranking.priorities.insert(ranking.priorities.end(), orders.begin(), orders.end());
        for (std::size_t s = 0; s < count; ++s) {
            const Maneuver* none = ranking.maneuvers.empty() ? nullptr : &ranking.maneuvers.front();
            ranking.maneuvers.push_back(maneuver(outcomes, s, vehicles, none));
        }
    };
    std::vector<std::int8_t> batch(pairs);
    std::vector<float> position(frames), speed(frames), acceleration(frames);
    std::vector<std::uint8_t> enters(frames), present(frames);
    append(batch, 1, {position.data(), speed.data(), acceleration.data(), enters.data(), present.data()});
    const std::vector<std::int8_t> unhindered = crossing_order(map, traffic, ranking.pairs, position.data(), 1);
    Orders orders(map, traffic, ranking.pairs, {cooperative, unhindered});
    const std::size_t most = deadline.is_set() ? HURRIED : BATCH;
    batch.resize(most * pairs);
    std::size_t remaining = limit;
    while (const std::size_t found = orders.next(batch.data(), std::min(most, remaining))) {
        remaining -= found;
        if (imposes_anything({batch.data(), pairs})) { // else it is the only one
            append({batch.data(), found * pairs}, found, {});
        }
        if (deadline.passed()) {
            break;
        }
    }
    ranking.left_out = orders.count_remaining(deadline.is_set() ? BATCH : MOST_COUNTED);
    return ranking;
}

} // namespace intersection_env
