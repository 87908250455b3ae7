// What will happen, and how probable: every feasible crossing order with its probability.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "intersection_env/orders.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

class Predictor;
struct Kernel;

struct ForecastLimits {
    double mass = 0.95;                    // as many orders as have this probability together,
    std::size_t orders = 64;               // but no more than these, ours: what is predicted in a millisecond
    std::size_t feasible = MOST_MANEUVERS; // orders that share the probability
    double seconds =
        std::numeric_limits<double>::infinity(); // the search ends then; what it found depends on the machine
};

// The probability of an order is in proportion to the product of its pairs' probabilities, over all feasible orders;
// where these are more than `ForecastLimits::feasible`, over as many, beginning with the one that has each pair's more
// probable direction and changing the least certain pairs first.
struct OrderProbabilities {
    std::vector<Pair> pairs;           // find_conflicts of the traffic
    std::vector<std::int8_t> orders;   // (order, pair), the most probable first; 0 where neither can stop any more
    std::vector<double> probability;   // (order,)
    std::vector<double> yielder_first; // (pair,), over all feasible orders, not only those above
    std::size_t feasible = 0;          // orders that share the probability
    std::size_t left_out = 0;          // further ones, counted up to MOST_COUNTED
};

// given: (pair,), orders to which all others are conditional, +1 yielder first, -1 prioritized first, 0 open; empty:
// none. Where no order is feasible, one is returned that leaves all pairs that are not given to the gap decision.
// Throws std::invalid_argument for a policy without a forecast model, a traffic that is refused, contradictory orders,
// or limits out of range.
OrderProbabilities order_probabilities(const Predictor& predictor, const Traffic& traffic,
                                       std::span<const std::int8_t> given, const ForecastLimits& limits,
                                       const Kernel& kernel);

// What the order network sees of each pair: (pair, ORDER_INPUTS); pairs: find_conflicts of the traffic, which is
// checked.
std::vector<float> observe_orders(const Predictor& predictor, const Traffic& traffic, std::span<const Pair> pairs,
                                  const Kernel& kernel);

// Quantiles of each vehicle's position over time [m]: over the orders, and over what drivers do within one.
// probability: (order,); position: (order, STEPS + 1, vehicle); levels: from 0 to 1. Returns (level, STEPS + 1,
// vehicle), every step by itself: nobody is behind where it is now, but a low quantile may fall back from one step to
// the next, and beyond the end of its route a vehicle has left it. Throws std::invalid_argument for a level out of
// range.
std::vector<float> position_quantiles(const Spread& spread, std::span<const double> probability, const float* position,
                                      int vehicles, std::span<const double> levels);

} // namespace intersection_env
