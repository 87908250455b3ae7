#include "model/ranks.hpp"

#include <algorithm>
#include <iterator>
#include <set>
#include <string_view>
#include <vector>

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

std::string_view arm_of(const Route& route) { return std::string_view(route.id).substr(0, route.id.find('-')); }

// Of some routes, first those to which none of the others yields, or else the fewest.
std::vector<int> yielders_first(const Map& map, std::vector<int> left) {
    std::vector<int> sorted;
    while (!left.empty()) {
        const auto yield_to = [&](int route) {
            return std::ranges::count_if(left, [&](int other) { return map.conflict(other, route) != nullptr; });
        };
        const auto next = std::ranges::min_element(left, {}, yield_to);
        sorted.push_back(*next);
        left.erase(next);
    }
    return sorted;
}

} // namespace

void rank_routes(Map& map) {
    std::set<std::string_view> roads_with_priority; // arms from which somebody yields to nobody
    for (int route = 0; route < static_cast<int>(map.routes.size()); ++route) {
        if (std::ranges::none_of(map.conflicts, [route](const Conflict& c) { return c.yielder == route; })) {
            roads_with_priority.insert(arm_of(map.routes[at(route)]));
        }
    }
    std::vector<int> major, minor;
    for (int route = 0; route < static_cast<int>(map.routes.size()); ++route) {
        (roads_with_priority.contains(arm_of(map.routes[at(route)])) ? major : minor).push_back(route);
    }
    std::vector<int> ranked = yielders_first(map, major);
    std::ranges::reverse(ranked);
    std::ranges::copy(yielders_first(map, minor), std::back_inserter(ranked));
    for (int rank = 0; rank < static_cast<int>(ranked.size()); ++rank) {
        map.routes[at(ranked[at(rank)])].rank = rank;
    }
}

} // namespace intersection_env
