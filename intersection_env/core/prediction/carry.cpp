#include "prediction/carry.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "intersection_env/orders.hpp"

namespace intersection_env {

std::vector<std::int8_t> carry_priorities(const Map& map, std::span<const Pair> before,
                                          std::span<const std::int8_t> priorities, std::span<const int> vehicles,
                                          const Traffic& later) {
    const std::vector<Pair> after = find_conflicts(map, later);
    const auto key = [](const Pair& pair) { return std::pair(pair.yielder, pair.prioritized); };
    std::vector<std::int8_t> carried;
    carried.reserve(after.size());
    for (const Pair& pair : after) {
        const Pair old{vehicles[static_cast<std::size_t>(pair.yielder)],
                       vehicles[static_cast<std::size_t>(pair.prioritized)]};
        const auto found = std::ranges::lower_bound(before, key(old), {}, key);
        if (found == before.end() || key(*found) != key(old)) {
            throw std::invalid_argument("vehicle " + std::to_string(pair.yielder) + " and vehicle " +
                                        std::to_string(pair.prioritized) + " had no open conflict before");
        }
        carried.push_back(priorities[static_cast<std::size_t>(found - before.begin())]);
    }
    Completion completion;
    completion.prepare(map, later, after);
    std::vector<std::int8_t> completed = carried;
    try {
        completion.complete(completed);
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(
            std::string("this order cannot be kept to: vehicles of one lane have passed through each other, and ") +
            error.what());
    }
    return carried;
}

} // namespace intersection_env
