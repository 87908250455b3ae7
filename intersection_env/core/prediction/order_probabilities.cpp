#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "intersection_env/forecast.hpp"
#include "intersection_env/orders.hpp"
#include "prediction/order_features.hpp"
#include "prediction/predictor.hpp"

namespace intersection_env {
namespace {

constexpr std::size_t BATCH = 1024; // orders found at a time

std::size_t at(int index) { return static_cast<std::size_t>(index); }

const OrderNetwork& network_of(const Predictor& predictor) {
    if (!predictor.policy().forecast) {
        throw std::invalid_argument("the policy holds no order network, so it knows no probabilities");
    }
    return predictor.policy().forecast->order_network;
}

void check(const ForecastLimits& limits) {
    if (!(limits.mass > 0.0 && limits.mass <= 1.0)) {
        throw std::invalid_argument("mass must be above 0 and at most 1, not " + std::to_string(limits.mass));
    }
    if (limits.orders < 1 || limits.feasible < 1) {
        throw std::invalid_argument("at least one order must be allowed");
    }
}

// The feasible orders and the logarithm of each one's weight.
struct Weighted {
    std::vector<std::int8_t> orders; // (order, pair)
    std::vector<double> logarithm;

    void append(std::span<const std::int8_t> found, std::span<const float> logits) {
        const std::size_t pairs = logits.size(), count = pairs == 0 ? 1 : found.size() / pairs;
        orders.insert(orders.end(), found.begin(), found.end());
        for (std::size_t o = 0; o < count; ++o) {
            double sum = 0.0;
            for (std::size_t p = 0; p < pairs; ++p) {
                sum += 0.5 * found[o * pairs + p] * double{logits[p]};
            }
            logarithm.push_back(sum);
        }
    }
};

// Logarithms to probabilities, in place.
void normalise(std::vector<double>& logarithm) {
    const double most = std::ranges::max(logarithm);
    double sum = 0.0;
    for (double& value : logarithm) {
        value = std::exp(value - most);
        sum += value;
    }
    for (double& value : logarithm) {
        value /= sum;
    }
}

// What the probabilities of the orders (order, pair) say about each pair; where an order leaves it open, its own logit.
std::vector<double> yielder_first(std::span<const std::int8_t> orders, std::span<const double> probability,
                                  std::span<const float> logits) {
    const std::size_t pairs = logits.size();
    std::vector<double> first(pairs);
    for (std::size_t p = 0; p < pairs; ++p) {
        const double open = 1.0 / (1.0 + std::exp(-double{logits[p]}));
        for (std::size_t o = 0; o < probability.size(); ++o) {
            const std::int8_t direction = orders[o * pairs + p];
            first[p] += direction > 0 ? probability[o] : direction == 0 ? probability[o] * open : 0.0;
        }
        first[p] = std::min(first[p], 1.0); // rounding
    }
    return first;
}

// Keeps the most probable orders, in that order.
void keep_most_probable(const Weighted& all, std::size_t pairs, const ForecastLimits& limits,
                        OrderProbabilities& result) {
    std::vector<std::size_t> rows(all.logarithm.size());
    std::iota(rows.begin(), rows.end(), std::size_t{0});
    const std::size_t most = std::min(limits.orders, rows.size());
    const auto before = [&](std::size_t a, std::size_t b) {
        return all.logarithm[a] != all.logarithm[b] ? all.logarithm[a] > all.logarithm[b] : a < b;
    };
    std::partial_sort(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(most), rows.end(), before);
    double mass = 0.0;
    for (std::size_t k = 0; k < most && mass < limits.mass; ++k) {
        mass += all.logarithm[rows[k]];
        result.probability.push_back(all.logarithm[rows[k]]);
        const auto begin = all.orders.begin() + static_cast<std::ptrdiff_t>(rows[k] * pairs);
        result.orders.insert(result.orders.end(), begin, begin + static_cast<std::ptrdiff_t>(pairs));
    }
}

} // namespace

std::vector<float> observe_orders(const Predictor& predictor, const Traffic& traffic, const Kernel& kernel) {
    check(predictor.map(), traffic);
    const std::vector<Pair> pairs = find_conflicts(predictor.map(), traffic);
    std::vector<float> driving(at(traffic.count()) * DRIVING_INPUTS), gap(pairs.size() * GAP_INPUTS);
    std::vector<std::uint8_t> accepts(pairs.size());
    predictor.observe(traffic, driving.data(), gap.data(), accepts.data(), kernel);
    std::vector<float> features(pairs.size() * ORDER_INPUTS);
    order_features(predictor.map(), traffic, pairs, driving.data(), features.data());
    return features;
}

OrderProbabilities order_probabilities(const Predictor& predictor, const Traffic& traffic,
                                       std::span<const std::int8_t> given, const ForecastLimits& limits,
                                       const Kernel& kernel) {
    const OrderNetwork& network = network_of(predictor);
    check(limits);
    const std::vector<float> features = observe_orders(predictor, traffic, kernel);
    const Map& map = predictor.map();
    OrderProbabilities result;
    result.pairs = find_conflicts(map, traffic);
    const std::size_t pairs = result.pairs.size();
    if (!given.empty() && given.size() != pairs) {
        throw std::invalid_argument("given takes one direction a pair, " + std::to_string(pairs));
    }
    std::vector<float> logits(pairs), certainty;
    kernel.evaluate_order(network, features.data(), static_cast<long>(pairs), logits.data());
    std::vector<std::int8_t> held(given.begin(), given.end()), likely;
    held.resize(pairs);
    Completion completion;
    completion.prepare(map, traffic, result.pairs);
    completion.complete(held);
    for (const float logit : logits) {
        likely.push_back(logit > 0.0F ? 1 : -1);
        certainty.push_back(std::abs(logit));
    }
    const std::vector<std::uint8_t> all(at(traffic.count()), 1);
    Orders orders(map, traffic, result.pairs, {all, likely, certainty, held});
    Weighted weighted;
    std::vector<std::int8_t> batch(BATCH * pairs);
    std::size_t remaining = limits.feasible;
    while (const std::size_t found = orders.next(batch.data(), std::min(BATCH, remaining))) {
        remaining -= found;
        weighted.append({batch.data(), found * pairs}, logits);
    }
    if (weighted.logarithm.empty()) {
        weighted.append(held, logits);
    }
    result.feasible = weighted.logarithm.size();
    result.left_out = orders.count_remaining(MOST_COUNTED);
    normalise(weighted.logarithm);
    result.yielder_first = yielder_first(weighted.orders, weighted.logarithm, logits);
    keep_most_probable(weighted, pairs, limits, result);
    return result;
}

} // namespace intersection_env
