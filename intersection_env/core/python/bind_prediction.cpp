// Policies, and the predictor.
#include "python/bind.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "intersection_env/forecast.hpp"
#include "intersection_env/policy.hpp"
#include "kernel/dispatch.hpp"
#include "prediction/predictor.hpp"
#include "python/arrays.hpp"

namespace intersection_env::python {

using namespace nb::literals;

namespace {

using Floats = nb::ndarray<nb::numpy, float>;
using Flags = nb::ndarray<nb::numpy, std::uint8_t>;

using Shorts = nb::ndarray<nb::numpy, std::int16_t>;
using Counts = nb::ndarray<nb::numpy, std::int32_t>;
using Directions = nb::ndarray<nb::numpy, std::int8_t>;

std::tuple<Floats, Floats, Floats, Flags, Flags, Floats, Floats, Shorts, Directions, std::optional<Counts>, Floats>
predict(const Predictor& predictor, const Traffic& traffic, const Matrix<std::int8_t>& assignments, bool trajectories,
        bool safety, const std::optional<nb::ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig>>& decisions,
        const std::optional<std::string>& isa) {
    const std::size_t scenarios = assignments.shape(0), vehicles = traffic.route.size();
    const std::vector<std::size_t> shape{trajectories ? scenarios : 0, STEPS + 1, vehicles};
    auto position = make<float>(shape), speed = make<float>(shape), acceleration = make<float>(shape);
    auto enters = make<std::uint8_t>(shape), present = make<std::uint8_t>(shape);
    auto hold = make<std::int16_t>(shape);
    std::optional<Counts> waited;
    if (trajectories && predictor.map().has_stops()) {
        waited = make<std::int32_t>(shape);
    }
    auto time_loss = make<float>({scenarios, vehicles});
    auto minimum_distance = make<float>({safety ? scenarios : 0});
    Results results;
    if (trajectories) {
        results.trajectories = {position.data(),
                                speed.data(),
                                acceleration.data(),
                                enters.data(),
                                present.data(),
                                hold.data(),
                                waited ? waited->data() : nullptr};
    }
    results.time_loss = time_loss.data();
    results.minimum_distance = safety ? minimum_distance.data() : nullptr;
    auto patience = make<float>({vehicles});
    results.patience = patience.data();
    auto completed = make<std::int8_t>({scenarios, assignments.shape(1)});
    std::copy_n(assignments.data(), assignments.size(), completed.data());
    const std::span<const std::uint8_t> replayed =
        decisions ? std::span<const std::uint8_t>(decisions->data(), decisions->size())
                  : std::span<const std::uint8_t>();
    {
        const nb::gil_scoped_release release;
        predictor.predict(traffic, {completed.data(), completed.size()}, static_cast<int>(scenarios), replayed, results,
                          isa ? kernel_named(*isa) : kernel());
    }
    return std::make_tuple(position, speed, acceleration, enters, present, time_loss, minimum_distance, hold, completed,
                           waited, patience);
}

// Without trajectories: what is not wanted is not made, which for one scenario is a tenth of the time.
std::tuple<Floats, Floats> summarize(const Predictor& predictor, const Traffic& traffic,
                                     const Matrix<std::int8_t>& assignments, bool safety,
                                     const std::optional<std::string>& isa, bool apart) {
    const std::size_t scenarios = assignments.shape(0);
    std::vector<std::int8_t> completed(assignments.data(), assignments.data() + assignments.size());
    auto time_loss = make<float>({scenarios, traffic.route.size()});
    auto minimum_distance = make<float>({safety ? scenarios : 0});
    Results results;
    results.time_loss = time_loss.data();
    results.minimum_distance = safety ? minimum_distance.data() : nullptr;
    results.apart = apart;
    {
        const nb::gil_scoped_release release;
        predictor.predict(traffic, completed, static_cast<int>(scenarios), {}, results,
                          isa ? kernel_named(*isa) : kernel());
    }
    return {time_loss, minimum_distance};
}

Floats patience_at(const Predictor& predictor, const Traffic& traffic, const Vector<double>& levels) {
    const std::vector<float> found = predictor.patience(traffic, {levels.data(), levels.size()}, kernel());
    return copied(found, {found.size()});
}

std::tuple<Floats, Floats, Flags> observe(const Predictor& predictor, const Traffic& traffic) {
    const std::size_t vehicles = traffic.route.size();
    check(predictor.map(), traffic);
    const std::vector<Pair> pairs = find_conflicts(predictor.map(), traffic);
    auto driving = make<float>({vehicles, DRIVING_INPUTS});
    auto gap = make<float>({pairs.size(), GAP_INPUTS});
    auto accepts = make<std::uint8_t>({pairs.size()});
    predictor.observe(traffic, pairs, driving.data(), gap.data(), accepts.data(), kernel());
    return std::make_tuple(driving, gap, accepts);
}

// One network's outputs before the last activation, for rows of features.
Floats evaluate_gap(const Policy& policy, const Matrix<float>& features) {
    if (!policy.gap_network || features.shape(1) != GAP_INPUTS) {
        throw std::invalid_argument("a policy with a gap network and features (row, 4) are wanted");
    }
    auto out = make<float>({features.shape(0)});
    kernel().evaluate_gap(*policy.gap_network, features.data(), static_cast<long>(features.shape(0)), out.data());
    return out;
}

Floats evaluate_driving(const Policy& policy, const Matrix<float>& features) {
    if (!policy.driving_network || features.shape(1) != DRIVING_INPUTS) {
        throw std::invalid_argument("a policy with a driving network and features (row, 12) are wanted");
    }
    auto out = make<float>({features.shape(0)});
    kernel().evaluate_driving(*policy.driving_network, features.data(), static_cast<long>(features.shape(0)),
                              out.data());
    return out;
}

Floats evaluate_order(const Policy& policy, const Matrix<float>& features) {
    if (!policy.forecast || features.shape(1) != ORDER_INPUTS) {
        throw std::invalid_argument("a policy with an order network and features (row, 21) are wanted");
    }
    auto out = make<float>({features.shape(0)});
    kernel().evaluate_order(policy.forecast->order_network, features.data(), static_cast<long>(features.shape(0)),
                            out.data());
    return out;
}

} // namespace

void bind_prediction(nb::module_& m) {
    nb::class_<Policy>(m, "Policy")
        .def(nb::new_(
                 [](std::string text, std::string where) { return Policy::parse(std::move(text), std::move(where)); }),
             "text"_a, "where"_a, "Reads the text of a policy file, named `where` in errors; raises FormatError.")
        .def_ro("about", &Policy::about, "Provenance and scores, JSON.")
        .def("evaluate_gap", &evaluate_gap, "features"_a.noconvert(), "(row,): logits of accepting the gap.")
        .def_prop_ro(
            "can_forecast", [](const Policy& policy) { return policy.forecast.has_value(); },
            "Whether it holds an order network and a spread.")
        .def("evaluate_order", &evaluate_order, "features"_a.noconvert(), "(row,): logits of the yielder going first.")
        .def("evaluate_driving", &evaluate_driving, "features"_a.noconvert(),
             "(row,): the driving network's output before its last tanh.");

    nb::class_<Predictor>(m, "Predictor")
        .def(nb::new_([](std::shared_ptr<const Map> map, Policy policy, int threads,
                         const std::optional<std::string>& patience) {
                 return std::make_shared<Predictor>(std::move(map), std::move(policy), threads,
                                                    patience ? std::optional(patience_named(*patience)) : std::nullopt);
             }),
             "map"_a, "policy"_a, "threads"_a = 1, "patience"_a = nb::none(),
             "patience: \"none\" or \"kept\"; None: the default of its gap decision.")
        .def_prop_ro(
            "patience_kept", [](const Predictor& predictor) { return predictor.patience() == Patience::kept; },
            "Whether drivers keep the quantile by which they accept gaps.")
        .def("observe", &observe, "traffic"_a,
             "driving (vehicle, 12) and gap (pair, 4) features, and which pairs' gaps are accepted (pair,).")
        .def(
            "observe_orders",
            [](const Predictor& predictor, const Traffic& traffic) {
                check(predictor.map(), traffic);
                const std::vector<Pair> pairs = find_conflicts(predictor.map(), traffic);
                const std::vector<float> features = observe_orders(predictor, traffic, pairs, kernel());
                return copied(features, {features.size() / ORDER_INPUTS, ORDER_INPUTS});
            },
            "traffic"_a, "(pair, 21): what an order network sees.")
        .def(
            "predict", &predict, "traffic"_a, "assignments"_a.noconvert(), "trajectories"_a, "safety"_a,
            "decisions"_a.noconvert().none() = nb::none(), "isa"_a = nb::none(),
            "position, speed, acceleration, enters, present, time_loss, minimum_distance, hold, completed assignments, "
            "waited, patience.")
        .def("summarize", &summarize, "traffic"_a, "assignments"_a.noconvert(), "safety"_a, "isa"_a = nb::none(),
             "apart"_a = false,
             "time_loss, minimum_distance: as of predict, without trajectories. apart: each scenario by itself, "
             "whatever it has in common with others.")
        .def("keeps_patience", &Predictor::keeps_patience, "traffic"_a,
             "Whether drivers keep anything in a prediction of this traffic.")
        .def("patience", &patience_at, "traffic"_a, "levels"_a.noconvert(),
             "(vehicle,): the patience of the driver at each vehicle's level (vehicle,).");
}

} // namespace intersection_env::python
