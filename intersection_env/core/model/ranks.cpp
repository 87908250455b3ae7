#include "model/ranks.hpp"

#include <algorithm>
#include <iterator>
#include <set>
#include <string_view>
#include <vector>

namespace intersection_env {
namespace {

using Relation = std::vector<std::vector<bool>>; // (route, route)

std::size_t at(int index) { return static_cast<std::size_t>(index); }

std::string_view arm_of(const Route& route) { return std::string_view(route.id).substr(0, route.id.find('-')); }

// Of these routes, which yields to which, or to one that does, and so on.
Relation yields_through(const Map& map, const std::vector<int>& routes) {
    Relation result(map.routes.size(), std::vector<bool>(map.routes.size()));
    for (const int a : routes) {
        for (const int b : routes) {
            result[at(a)][at(b)] = map.conflict(a, b) != nullptr;
        }
    }
    for (const int between : routes) {
        for (const int a : routes) {
            for (const int b : routes) {
                result[at(a)][at(b)] =
                    result[at(a)][at(b)] || (result[at(a)][at(between)] && result[at(between)][at(b)]);
            }
        }
    }
    return result;
}

// Of these routes, first those to which none of the others yields. Of a circle, to which nobody else yields, the one to
// which the fewest do.
std::vector<int> yielders_first(const Map& map, std::vector<int> left) {
    const Relation through = yields_through(map, left);
    std::vector<int> sorted;
    while (!left.empty()) {
        // How many yield to it; as many as none can have, where it is not its turn yet.
        const auto yielders = [&](int route) {
            const auto yields = [&](int other) { return map.conflict(other, route) != nullptr; };
            const auto comes_first = [&](int other) { return yields(other) && !through[at(route)][at(other)]; };
            const bool waits = std::ranges::any_of(left, comes_first);
            return waits ? std::ssize(left) : std::ranges::count_if(left, yields);
        };
        const auto next = std::ranges::min_element(left, {}, yielders);
        sorted.push_back(*next);
        left.erase(next);
    }
    return sorted;
}

// The arms from which some route yields to nobody, and another to it: one that meets nobody says nothing.
std::set<std::string_view> arms_with_priority(const Map& map) {
    std::set<std::string_view> arms;
    for (const Conflict& conflict : map.conflicts) {
        const int route = conflict.prioritized;
        if (std::ranges::none_of(map.conflicts, [route](const Conflict& c) { return c.yielder == route; })) {
            arms.insert(arm_of(map.routes[at(route)]));
        }
    }
    return arms;
}

} // namespace

void rank_routes(Map& map) {
    const std::set<std::string_view> with_priority = arms_with_priority(map);
    std::vector<int> major, minor;
    for (int route = 0; route < static_cast<int>(map.routes.size()); ++route) {
        (with_priority.contains(arm_of(map.routes[at(route)])) ? major : minor).push_back(route);
    }
    std::vector<int> ranked = yielders_first(map, major);
    std::ranges::reverse(ranked);
    std::ranges::copy(yielders_first(map, minor), std::back_inserter(ranked));
    for (int rank = 0; rank < static_cast<int>(ranked.size()); ++rank) {
        map.routes[at(ranked[at(rank)])].rank = rank;
    }
}

} // namespace intersection_env
