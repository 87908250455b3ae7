// All feasible crossing orders of a traffic with their weights: what forecasts and rankings begin with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/traffic.hpp"
#include "kernel/dispatch.hpp"
#include "prediction/deadline.hpp"
#include "prediction/predictor.hpp"

namespace intersection_env {

struct WeighedOrders {
    std::vector<Pair> pairs;         // find_conflicts of the traffic
    std::vector<float> logits;       // (pair,) of the yielder going first
    std::vector<std::int8_t> orders; // (order, pair), at least one: what is given alone, where none is feasible
    bool feasible = true;            // whether any is
    std::vector<double> logarithm;   // (order,) of its weight: half the sum of the logits for it, less those against it
    std::size_t left_out = 0;        // further ones, of those never found at most MOST_COUNTED counted

    std::size_t count() const { return logarithm.size(); }
    std::span<const std::int8_t> order(std::size_t row) const {
        return {orders.data() + row * pairs.size(), pairs.size()};
    }
    void keep_first(std::size_t rows) {
        left_out += count() - rows;
        orders.resize(rows * pairs.size());
        logarithm.resize(rows);
    }
};

// given, and what is thrown: as of order_probabilities. most: orders found at most; deadline: no longer.
WeighedOrders weigh_orders(const Predictor& predictor, const Traffic& traffic, std::span<const std::int8_t> given,
                           std::size_t most, const Deadline& deadline, const Kernel& kernel);

// Probabilities in proportion to weights, from their logarithms; none of these may be left out.
std::vector<double> shares(std::span<const double> logarithm);

} // namespace intersection_env
