#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "intersection_env/forecast.hpp"
#include "prediction/order_features.hpp"
#include "prediction/weighed_orders.hpp"

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

void check(const ForecastLimits& limits) {
    if (!(limits.mass > 0.0 && limits.mass <= 1.0)) {
        throw std::invalid_argument("mass must be above 0 and at most 1, not " + std::to_string(limits.mass));
    }
    if (limits.orders < 1 || limits.feasible < 1) {
        throw std::invalid_argument("at least one order must be allowed");
    }
}

// What the probabilities of the orders say about each pair; where an order leaves it open, its own logit.
std::vector<double> yielder_first(const WeighedOrders& found, std::span<const double> probability) {
    std::vector<double> first(found.pairs.size());
    for (std::size_t p = 0; p < first.size(); ++p) {
        const double open = 1.0 / (1.0 + std::exp(-double{found.logits[p]}));
        for (std::size_t o = 0; o < probability.size(); ++o) {
            const std::int8_t direction = found.order(o)[p];
            first[p] += direction > 0 ? probability[o] : direction == 0 ? probability[o] * open : 0.0;
        }
        first[p] = std::min(first[p], 1.0); // rounding
    }
    return first;
}

// Keeps the most probable orders, in that order.
void keep_most_probable(const WeighedOrders& found, std::span<const double> probability, const ForecastLimits& limits,
                        OrderProbabilities& result) {
    std::vector<std::size_t> rows(found.count());
    std::iota(rows.begin(), rows.end(), std::size_t{0});
    const std::size_t most = std::min(limits.orders, rows.size());
    const auto before = [&](std::size_t a, std::size_t b) {
        return found.logarithm[a] != found.logarithm[b] ? found.logarithm[a] > found.logarithm[b] : a < b;
    };
    std::partial_sort(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(most), rows.end(), before);
    double mass = 0.0;
    for (std::size_t k = 0; k < most && mass < limits.mass; ++k) {
        mass += probability[rows[k]];
        result.probability.push_back(probability[rows[k]]);
        const auto order = found.order(rows[k]);
        result.orders.insert(result.orders.end(), order.begin(), order.end());
    }
}

} // namespace

std::vector<float> observe_orders(const Predictor& predictor, const Traffic& traffic, std::span<const Pair> pairs,
                                  const Kernel& kernel) {
    std::vector<float> driving(at(traffic.count()) * DRIVING_INPUTS), gap(pairs.size() * GAP_INPUTS);
    std::vector<std::uint8_t> accepts(pairs.size());
    predictor.observe(traffic, pairs, driving.data(), gap.data(), accepts.data(), kernel);
    std::vector<float> features(pairs.size() * ORDER_INPUTS);
    order_features(predictor.map(), traffic, pairs, driving.data(), features.data());
    return features;
}

OrderProbabilities order_probabilities(const Predictor& predictor, const Traffic& traffic,
                                       std::span<const std::int8_t> given, const ForecastLimits& limits,
                                       const Kernel& kernel) {
    check(limits);
    const WeighedOrders found =
        weigh_orders(predictor, traffic, given, limits.feasible, Deadline(limits.seconds), kernel);
    const std::vector<double> probability = shares(found.logarithm);
    OrderProbabilities result;
    result.pairs = found.pairs;
    result.feasible = found.count();
    result.left_out = found.left_out;
    result.yielder_first = yielder_first(found, probability);
    keep_most_probable(found, probability, limits, result);
    return result;
}

} // namespace intersection_env
