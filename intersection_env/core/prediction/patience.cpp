#include "prediction/patience.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace intersection_env {
namespace {

constexpr float STANDING_SPEED = 0.1F; // [m/s], ours: who still creeps up to its line has refused nothing yet
constexpr float AT_LINE = 5.0F;        // [m], ours: no other car fits between

std::size_t at(int index) { return static_cast<std::size_t>(index); }

bool goes(const Map& map, const Traffic& traffic, int vehicle) {
    return traffic.has_memories() ? traffic.delta[at(vehicle)] != 0 : committed(map, traffic, vehicle);
}

// Of the gaps that are asked for; none where nobody is in the way, or all who are wait themselves.
std::optional<double> least_logit(const Map& map, const Traffic& traffic, int vehicle, std::span<const Pair> pairs,
                                  std::span<const float> logits) {
    const int rank = map.routes[at(traffic.route[at(vehicle)])].rank;
    std::optional<double> least;
    for (std::size_t p = 0; p < pairs.size(); ++p) {
        const bool is_held = traffic.has_memories() && traffic.hold[at(pairs[p].prioritized)] > rank;
        if (pairs[p].yielder == vehicle && !is_held) {
            least = std::min(least.value_or(logits[p]), double{logits[p]});
        }
    }
    return least;
}

} // namespace

bool waits(const Map& map, const Traffic& traffic, int vehicle) {
    const float to_line = map.routes[at(traffic.route[at(vehicle)])].stop_line - traffic.front(vehicle);
    return traffic.speed[at(vehicle)] < STANDING_SPEED && to_line <= AT_LINE && !goes(map, traffic, vehicle);
}

float patience_of(const Map& map, const Traffic& traffic, int vehicle, std::span<const Pair> pairs,
                  std::span<const float> logits, double level) {
    const std::optional<double> refused =
        waits(map, traffic, vehicle) ? least_logit(map, traffic, vehicle, pairs, logits) : std::nullopt;
    if (!refused) {
        return static_cast<float>(std::log(level / (1.0 - level)));
    }
    // log((e^refused + level) / (1 - level)), of numbers that do not overflow.
    const double most = std::max(*refused, 0.0);
    const double odds = std::exp(*refused - most) + level * std::exp(-most);
    return static_cast<float>(most + std::log(odds / (1.0 - level)));
}

} // namespace intersection_env
