#include "prediction/weighed_orders.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "intersection_env/forecast.hpp"
#include "intersection_env/orders.hpp"

namespace intersection_env {
namespace {

constexpr std::size_t BATCH = 1024; // orders found at a time

std::size_t at(int index) { return static_cast<std::size_t>(index); }

// What all orders hold: what is given, and what follows from it.
std::vector<std::int8_t> held(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                              std::span<const std::int8_t> given) {
    if (!given.empty() && given.size() != pairs.size()) {
        throw std::invalid_argument("given takes one direction a pair, " + std::to_string(pairs.size()));
    }
    std::vector<std::int8_t> directions(given.begin(), given.end());
    directions.resize(pairs.size());
    Completion completion;
    completion.prepare(map, traffic, pairs);
    completion.complete(directions);
    return directions;
}

double weight(std::span<const std::int8_t> order, std::span<const float> logits) {
    double sum = 0.0;
    for (std::size_t p = 0; p < order.size(); ++p) {
        sum += 0.5 * order[p] * double{logits[p]};
    }
    return sum;
}

} // namespace

WeighedOrders weigh_orders(const Predictor& predictor, const Traffic& traffic, std::span<const std::int8_t> given,
                           std::size_t most, const Deadline& deadline, const Kernel& kernel) {
    if (!predictor.policy().forecast) {
        throw std::invalid_argument("the policy holds no order network, so it knows no probabilities");
    }
    check(predictor.map(), traffic);
    WeighedOrders result;
    result.pairs = find_conflicts(predictor.map(), traffic);
    const std::vector<float> features = observe_orders(predictor, traffic, result.pairs, kernel);
    const std::size_t pairs = result.pairs.size();
    result.logits.resize(pairs);
    kernel.evaluate_order(predictor.policy().forecast->order_network, features.data(), static_cast<long>(pairs),
                          result.logits.data());
    const std::vector<std::int8_t> fixed = held(predictor.map(), traffic, result.pairs, given);
    std::vector<std::int8_t> likely;
    std::vector<float> certainty;
    for (const float logit : result.logits) {
        likely.push_back(logit > 0.0F ? 1 : -1);
        certainty.push_back(std::abs(logit));
    }
    const std::vector<std::uint8_t> everybody(at(traffic.count()), 1);
    Orders search(predictor.map(), traffic, result.pairs, {everybody, likely, certainty, fixed});
    std::vector<std::int8_t> batch(BATCH * pairs);
    while (const std::size_t found = search.next(batch.data(), std::min(BATCH, most - result.count()))) {
        result.orders.insert(result.orders.end(), batch.data(), batch.data() + found * pairs);
        for (std::size_t o = 0; o < found; ++o) {
            result.logarithm.push_back(weight({batch.data() + o * pairs, pairs}, result.logits));
        }
        if (deadline.passed()) {
            break;
        }
    }
    result.left_out = search.count_remaining(deadline.is_set() ? BATCH : MOST_COUNTED);
    if (result.logarithm.empty()) {
        result.feasible = false;
        result.orders = fixed;
        result.logarithm = {0.0};
    }
    return result;
}

std::vector<double> shares(std::span<const double> logarithm) {
    const double most = std::ranges::max(logarithm);
    std::vector<double> result;
    double sum = 0.0;
    for (const double value : logarithm) {
        result.push_back(std::exp(value - most));
        sum += result.back();
    }
    for (double& value : result) {
        value /= sum;
    }
    return result;
}

} // namespace intersection_env
