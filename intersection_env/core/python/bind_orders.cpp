// Crossing orders: enumerated, given probabilities, ranked as maneuvers, in words.
#include "python/bind.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "intersection_env/forecast.hpp"
#include "intersection_env/maneuvers.hpp"
#include "intersection_env/orders.hpp"
#include "kernel/dispatch.hpp"
#include "prediction/carry.hpp"
#include "prediction/predictor.hpp"
#include "python/arrays.hpp"

namespace intersection_env::python {

using namespace nb::literals;

namespace {

using Floats = nb::ndarray<nb::numpy, float>;
using Doubles = nb::ndarray<nb::numpy, double>;
using Directions = nb::ndarray<nb::numpy, std::int8_t>;

Orders make_orders(const Map& map, const Traffic& traffic, const Vector<std::uint8_t>& cooperative,
                   const Vector<std::int8_t>& preferred) {
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    if (cooperative.size() != traffic.route.size() || preferred.size() != pairs.size()) {
        throw std::invalid_argument("cooperative takes one flag a vehicle, preferred one direction a pair");
    }
    return {map, traffic, pairs, {{cooperative.data(), cooperative.size()}, {preferred.data(), preferred.size()}}};
}

template <class T, class Field>
nb::ndarray<nb::numpy, T> column(const Ranking& ranking, Field Maneuver::* field) {
    auto array = make<T>({ranking.maneuvers.size()});
    std::transform(ranking.maneuvers.begin(), ranking.maneuvers.end(), array.data(),
                   [field](const Maneuver& maneuver) { return static_cast<T>(maneuver.*field); });
    return array;
}

std::tuple<Arrays, std::size_t> rank(const Predictor& predictor, const Traffic& traffic,
                                     const Vector<std::uint8_t>& cooperative, std::optional<std::size_t> limit,
                                     double seconds, std::optional<bool> by_expectation) {
    const auto by =
        by_expectation ? std::optional(*by_expectation ? RankBy::expectation : RankBy::prediction) : std::nullopt;
    Ranking ranking;
    {
        const nb::gil_scoped_release release;
        ranking = rank_maneuvers(predictor, traffic, {cooperative.data(), cooperative.size()}, {limit, seconds}, by,
                                 kernel());
    }
    Arrays columns;
    columns["total_time_loss"] = column<double>(ranking, &Maneuver::total_time_loss);
    columns["worst_time_loss"] = column<double>(ranking, &Maneuver::worst_time_loss);
    columns["gain"] = column<double>(ranking, &Maneuver::gain);
    columns["chance_worthwhile"] = column<double>(ranking, &Maneuver::chance_worthwhile);
    columns["chance_unsafe"] = column<double>(ranking, &Maneuver::chance_unsafe);
    columns["worth_executing"] = column<bool>(ranking, &Maneuver::worth_executing);
    columns["minimum_distance"] = column<double>(ranking, &Maneuver::minimum_distance);
    columns["followed"] = column<bool>(ranking, &Maneuver::followed);
    columns["safe"] = column<bool>(ranking, &Maneuver::safe);
    columns["intervention"] = column<bool>(ranking, &Maneuver::intervention);
    columns["priorities"] = copied(ranking.priorities, {ranking.maneuvers.size(), ranking.pairs.size()});
    return {columns, ranking.left_out};
}

std::tuple<Directions, Doubles, Doubles, std::size_t, std::size_t>
probabilities(const Predictor& predictor, const Traffic& traffic, const Vector<std::int8_t>& given, double mass,
              std::size_t most, std::size_t feasible, double seconds) {
    OrderProbabilities found;
    {
        const nb::gil_scoped_release release;
        found = order_probabilities(predictor, traffic, {given.data(), given.size()}, {mass, most, feasible, seconds},
                                    kernel());
    }
    const std::size_t pairs = found.pairs.size(), orders = found.probability.size();
    return std::make_tuple(copied(found.orders, {orders, pairs}), copied(found.probability, {orders}),
                           copied(found.yielder_first, {pairs}), found.feasible, found.left_out);
}

Floats quantiles(const Policy& policy, const Vector<double>& probability,
                 const nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>& position,
                 const Vector<double>& levels) {
    if (!policy.forecast || position.shape(0) != probability.size() || position.shape(1) != STEPS + 1) {
        throw std::invalid_argument("a policy with a spread and positions (order, " + std::to_string(STEPS + 1) +
                                    ", vehicle) are wanted");
    }
    const std::size_t vehicles = position.shape(2);
    const std::vector<float> found =
        position_quantiles(policy.forecast->spread, {probability.data(), probability.size()}, position.data(),
                           static_cast<int>(vehicles), {levels.data(), levels.size()});
    return copied(found, {levels.size(), STEPS + 1, vehicles});
}

Directions order_of(const Map& map, const Traffic& traffic,
                    const nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>& position) {
    if (position.shape(1) != STEPS + 1 || position.shape(2) != traffic.route.size()) {
        throw std::invalid_argument("position must be (scenario, " + std::to_string(STEPS + 1) + ", vehicle)");
    }
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    const std::vector<std::int8_t> order = crossing_order(map, traffic, pairs, position.data(), position.shape(0));
    return copied(order, {position.shape(0), pairs.size()});
}

std::vector<std::string> words_of(const Map& map, const Traffic& traffic, const std::vector<std::string>& names,
                                  const Matrix<std::int8_t>& orders) {
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    if (names.size() != traffic.route.size() || orders.shape(1) != pairs.size()) {
        throw std::invalid_argument("names take one entry a vehicle, orders (order, " + std::to_string(pairs.size()) +
                                    ")");
    }
    return in_words(map, traffic, pairs, names, orders.data(), orders.shape(0));
}

} // namespace

void bind_orders(nb::module_& m) {
    m.def(
        "complete",
        [](const Map& map, const Traffic& traffic, const Matrix<std::int8_t>& assignments) {
            const std::vector<Pair> pairs = find_conflicts(map, traffic);
            if (assignments.shape(1) != pairs.size()) {
                throw std::invalid_argument("assignments must be (scenario, " + std::to_string(pairs.size()) + ")");
            }
            auto array = make<std::int8_t>({assignments.shape(0), pairs.size()});
            std::copy(assignments.data(), assignments.data() + assignments.size(), array.data());
            Completion completion;
            completion.prepare(map, traffic, pairs);
            for (std::size_t s = 0; s < assignments.shape(0); ++s) {
                completion.complete({array.data() + s * pairs.size(), pairs.size()});
            }
            return array;
        },
        "map"_a, "traffic"_a, "assignments"_a.noconvert(),
        "(scenario, pair): the assignments and what they imply; raises ValueError for a contradiction.");

    m.def(
        "carry_priorities",
        [](const Map& map, const Traffic& before, const Vector<std::int8_t>& priorities, const Vector<int>& vehicles,
           const Traffic& after) {
            const std::vector<Pair> pairs = find_conflicts(map, before);
            if (priorities.size() != pairs.size() || vehicles.size() != after.route.size()) {
                throw std::invalid_argument("priorities take one direction a pair before, vehicles one index a vehicle "
                                            "after");
            }
            const std::vector<std::int8_t> carried = carry_priorities(
                map, pairs, {priorities.data(), priorities.size()}, {vehicles.data(), vehicles.size()}, after);
            return copied(carried, {carried.size()});
        },
        "map"_a, "before"_a, "priorities"_a.noconvert(), "vehicles"_a.noconvert(), "after"_a,
        "(pair after,): the priorities (pair before,) of the pairs still open; vehicles: (vehicle after,) indices "
        "before.");

    nb::class_<Orders>(m, "Orders", "Streams the crossing orders of a traffic.")
        .def(nb::new_(&make_orders), "map"_a, "traffic"_a, "cooperative"_a.noconvert(), "preferred"_a.noconvert())
        .def(
            "next",
            [](Orders& orders, std::size_t most) {
                const std::size_t pairs = orders.pair_count();
                std::vector<std::int8_t> buffer(most * pairs + 1);
                const std::size_t count = orders.next(buffer.data(), most);
                auto array = make<std::int8_t>({count, pairs});
                std::copy_n(buffer.data(), count * pairs, array.data());
                return array;
            },
            "most"_a, "(order, pair): up to `most` further orders.")
        .def("count_remaining", &Orders::count_remaining, "most"_a, "How many are left, counted up to `most`.");
}

void bind_rankings(nb::module_& m) {
    m.def("rank_maneuvers", &rank, "predictor"_a, "traffic"_a, "cooperative"_a.noconvert(), "limit"_a.none(),
          "seconds"_a, "by_expectation"_a.none(),
          "Every crossing order and no intervention, ranked: columns (maneuver,), priorities (maneuver, pair); and how "
          "many orders were left out.");
    m.def("order_probabilities", &probabilities, "predictor"_a, "traffic"_a, "given"_a.noconvert(), "mass"_a, "most"_a,
          "feasible"_a, "seconds"_a = std::numeric_limits<double>::infinity(),
          "The most probable orders (order, pair) and their probability (order,), that of each yielder going first "
          "(pair,), how many orders are feasible and how many were left out.");
    m.def("position_quantiles", &quantiles, "policy"_a, "probability"_a.noconvert(), "position"_a.noconvert(),
          "levels"_a.noconvert(), "(level, time, vehicle) of positions (order, time, vehicle) [m].");
    m.def("crossing_order", &order_of, "map"_a, "traffic"_a, "position"_a.noconvert(),
          "(scenario, pair): who reached each conflict first in positions (scenario, time, vehicle).");
    m.def("in_words", &words_of, "map"_a, "traffic"_a, "names"_a, "orders"_a.noconvert(),
          "Orders (order, pair) as sequences of vehicles.");
}

} // namespace intersection_env::python
