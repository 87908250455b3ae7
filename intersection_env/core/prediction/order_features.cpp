#include "prediction/order_features.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace intersection_env {
namespace {

constexpr float LATEST = 12.0F;     // [s], ours: later than any order is decided; stands for nobody, too
constexpr float LEAST_SPEED = 1.0F; // [m/s], ours: who stands may start at any moment
constexpr int LIMIT = 2, LEAD_DISTANCE = 9, LEAD_SPEED = 10; // of DRIVING_FEATURES

std::size_t at(int index) { return static_cast<std::size_t>(index); }

struct Sight {
    const Map& map;
    const Traffic& traffic;
    const float* driving;

    const Conflict& conflict(const Pair& pair) const {
        return *map.conflict(traffic.route[at(pair.yielder)], traffic.route[at(pair.prioritized)]);
    }

    // Eight features of one vehicle of a pair.
    float* write(int vehicle, const Interval& interval, float* out) const {
        const float* seen = driving + vehicle * DRIVING_INPUTS;
        *out++ = interval.begin - traffic.front(vehicle);
        *out++ = interval.end - traffic.rear(vehicle);
        *out++ = map.routes[at(traffic.route[at(vehicle)])].stop_line - traffic.front(vehicle);
        *out++ = traffic.speed[at(vehicle)];
        for (const int column : {LIMIT, LEAD_DISTANCE, LEAD_SPEED}) {
            *out++ = seen[column];
        }
        *out++ = traffic.length[at(vehicle)];
        return out;
    }

    // When the prioritized vehicle reaches the conflict with the speed that it has [s].
    float arrival(const Pair& pair) const {
        const float way = conflict(pair).on_prioritized.begin - traffic.front(pair.prioritized);
        return std::min(way / std::max(traffic.speed[at(pair.prioritized)], LEAST_SPEED), LATEST);
    }
};

} // namespace

void order_features(const Map& map, const Traffic& traffic, std::span<const Pair> pairs, const float* driving,
                    float* out) {
    const Sight sight{map, traffic, driving};
    std::vector<float> arrivals;
    for (const Pair& pair : pairs) {
        arrivals.push_back(sight.arrival(pair));
    }
    // The first arrival among those to whom a vehicle yields, one pair left out; and how many they are.
    const auto foes = [&](int vehicle, std::size_t but) {
        float first = LATEST, count = 0.0F;
        for (std::size_t q = 0; q < pairs.size(); ++q) {
            if (pairs[q].yielder == vehicle && q != but) {
                first = std::min(first, arrivals[q]);
                count += 1.0F;
            }
        }
        return std::pair(first, count);
    };
    for (std::size_t p = 0; p < pairs.size(); ++p) {
        const Conflict& conflict = sight.conflict(pairs[p]);
        out = sight.write(pairs[p].yielder, conflict.on_yielder, out);
        out = sight.write(pairs[p].prioritized, conflict.on_prioritized, out);
        const auto others = foes(pairs[p].yielder, p), of_foe = foes(pairs[p].prioritized, pairs.size());
        for (const float value :
             {conflict.merging ? 1.0F : 0.0F, others.first, others.second, of_foe.first, of_foe.second}) {
            *out++ = value;
        }
    }
}

} // namespace intersection_env
