// What of a crossing order is left for a later traffic.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/traffic.hpp"

namespace intersection_env {

// The priorities of the pairs that are open in the later traffic, out of those (pair,) of the pairs `before`. vehicles:
// for each vehicle of the later traffic, its index before, ascending. Throws std::invalid_argument for a pair that was
// not open before, and where the later traffic cannot keep to them, as vehicles of one lane have passed through each
// other.
std::vector<std::int8_t> carry_priorities(const Map& map, std::span<const Pair> before,
                                          std::span<const std::int8_t> priorities, std::span<const int> vehicles,
                                          const Traffic& later);

} // namespace intersection_env
