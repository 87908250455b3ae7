// What of a crossing order is left for a later traffic.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/traffic.hpp"

namespace intersection_env {

// The priorities of the pairs `after`, out of those (pair,) of the pairs `before`; both sorted, as find_conflicts has
// them. vehicles: for each vehicle after, its index before, ascending. Throws std::invalid_argument for a pair that was
// not open before.
std::vector<std::int8_t> carry_priorities(std::span<const Pair> before, std::span<const std::int8_t> priorities,
                                          std::span<const int> vehicles, std::span<const Pair> after);

} // namespace intersection_env
