// By which gap a driver who has waited goes: the quantile that it keeps.
#pragma once

#include <span>

#include "intersection_env/traffic.hpp"

namespace intersection_env {

constexpr double MEDIAN = 0.5;

// Whether a vehicle waits at its line: it does not go, stands nearly, and nobody fits before it.
bool waits(const Map& map, const Traffic& traffic, int vehicle);

// The logit that a gap's must exceed, of the driver at `level` (above 0 and below 1) of those whose vehicle is here as
// it is: of those who wait, the ones that refuse the gaps to the pairs' prioritized vehicles. logits: (pair,) of the
// gap network.
float patience_of(const Map& map, const Traffic& traffic, int vehicle, std::span<const Pair> pairs,
                  std::span<const float> logits, double level);

} // namespace intersection_env
