// What an order network sees of each pair.
#pragma once

#include <span>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

// pairs: as find_conflicts gives them. driving: (vehicle, DRIVING_INPUTS), as Predictor::observe gives it; only what
// no policy has a say in is read. out: (pair, ORDER_INPUTS).
void order_features(const Map& map, const Traffic& traffic, std::span<const Pair> pairs, const float* driving,
                    float* out);

} // namespace intersection_env
