// The core as a Python module. Arrays are float32, int32 or int8, C-contiguous, never converted.
#include <algorithm>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "dispatch.hpp"
#include "map.hpp"
#include "orders.hpp"
#include "policy.hpp"
#include "predictor.hpp"
#include "text_reader.hpp"
#include "traffic.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace intersection_env;

namespace {

template <class T>
using Vector = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class T>
using Table = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// A NumPy array of its own memory, for the core to fill.
template <class T>
nb::ndarray<nb::numpy, T> make(std::vector<std::size_t> shape) {
    std::size_t size = 1;
    for (const std::size_t n : shape) {
        size *= n;
    }
    T* data = new T[size]();
    const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner);
}

template <class T>
std::vector<T> copy(const Vector<T>& values) {
    return {values.data(), values.data() + values.size()};
}

Traffic make_traffic(const Map& map, const Vector<int>& route, const Vector<float>& position,
                     const Vector<float>& speed, const Vector<float>& length, const Vector<float>& width,
                     const Vector<float>& max_speed) {
    Traffic traffic{copy(route), copy(position), copy(speed), copy(length), copy(width), copy(max_speed)};
    check(map, traffic);
    return traffic;
}

nb::ndarray<nb::numpy, int> as_array(const std::vector<Pair>& pairs) {
    auto array = make<int>({pairs.size(), 2});
    for (std::size_t p = 0; p < pairs.size(); ++p) {
        array.data()[2 * p] = pairs[p].yielder;
        array.data()[2 * p + 1] = pairs[p].prioritized;
    }
    return array;
}

std::vector<std::tuple<int, int, bool, float, float, float, float>> conflict_rows(const Map& map) {
    std::vector<std::tuple<int, int, bool, float, float, float, float>> rows;
    for (const Conflict& c : map.conflicts) {
        rows.emplace_back(c.yielder, c.prioritized, c.merging, c.on_yielder.begin, c.on_yielder.end,
                          c.on_prioritized.begin, c.on_prioritized.end);
    }
    return rows;
}

std::vector<std::tuple<int, int, float, float, float, float>> shared_lane_rows(const Map& map) {
    std::vector<std::tuple<int, int, float, float, float, float>> rows;
    for (const SharedLane& s : map.shared_lanes) {
        rows.emplace_back(s.a, s.b, s.split, s.merge_a, s.merge_b, s.offset);
    }
    return rows;
}

nb::ndarray<nb::numpy, float> sample(const Map& map, int route, const Vector<float>& position) {
    if (route < 0 || static_cast<std::size_t>(route) >= map.routes.size()) {
        throw nb::index_error("no such route");
    }
    auto array = make<float>({position.size(), 11});
    float* out = array.data();
    for (std::size_t k = 0; k < position.size(); ++k) {
        const Sample s = map.at(route, position.data()[k]);
        for (const float value : {s.x, s.y, s.heading, s.width, s.v_max}) {
            *out++ = value;
        }
        for (const float value : s.relative_heading) {
            *out++ = value;
        }
    }
    return array;
}

using Floats = nb::ndarray<nb::numpy, float>;
using Flags = nb::ndarray<nb::numpy, std::uint8_t>;

std::tuple<Floats, Floats, Floats, Flags, Flags, Floats, Floats>
predict(const Predictor& predictor, const Traffic& traffic, const Table<std::int8_t>& assignments, bool trajectories,
        bool safety, const std::optional<nb::ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig>>& decisions,
        const std::optional<std::string>& isa) {
    const std::size_t scenarios = assignments.shape(0), vehicles = traffic.route.size();
    const std::vector<std::size_t> shape{trajectories ? scenarios : 0, STEPS + 1, vehicles};
    auto position = make<float>(shape), speed = make<float>(shape), acceleration = make<float>(shape);
    auto enters = make<std::uint8_t>(shape), present = make<std::uint8_t>(shape);
    auto time_loss = make<float>({scenarios, vehicles});
    auto minimum_distance = make<float>({safety ? scenarios : 0});
    Results results;
    if (trajectories) {
        results.trajectories = {position.data(), speed.data(), acceleration.data(), enters.data(), present.data()};
    }
    results.time_loss = time_loss.data();
    results.minimum_distance = safety ? minimum_distance.data() : nullptr;
    std::vector<std::int8_t> completed(assignments.data(), assignments.data() + assignments.size());
    const std::span<const std::uint8_t> replayed =
        decisions ? std::span<const std::uint8_t>(decisions->data(), decisions->size())
                  : std::span<const std::uint8_t>();
    {
        const nb::gil_scoped_release release;
        predictor.predict(traffic, completed, static_cast<int>(scenarios), replayed, results,
                          isa ? kernel_named(*isa) : kernel());
    }
    return std::make_tuple(position, speed, acceleration, enters, present, time_loss, minimum_distance);
}

std::tuple<Floats, Floats, Flags> observe(const Predictor& predictor, const Traffic& traffic) {
    const std::size_t vehicles = traffic.route.size();
    const std::size_t pairs = find_conflicts(predictor.map(), traffic).size();
    auto driving = make<float>({vehicles, DRIVING_INPUTS});
    auto gap = make<float>({pairs, GAP_INPUTS});
    auto accepts = make<std::uint8_t>({pairs});
    predictor.observe(traffic, driving.data(), gap.data(), accepts.data(), kernel());
    return std::make_tuple(driving, gap, accepts);
}

// One network's outputs before the last activation, for rows of features.
Floats evaluate_gap(const Policy& policy, const Table<float>& features) {
    if (!policy.gap_network || features.shape(1) != GAP_INPUTS) {
        throw std::invalid_argument("a policy with a gap network and features (row, 4) are wanted");
    }
    auto out = make<float>({features.shape(0)});
    kernel().evaluate_gap(*policy.gap_network, features.data(), static_cast<long>(features.shape(0)), out.data());
    return out;
}

Floats evaluate_driving(const Policy& policy, const Table<float>& features) {
    if (!policy.driving_network || features.shape(1) != DRIVING_INPUTS) {
        throw std::invalid_argument("a policy with a driving network and features (row, 12) are wanted");
    }
    auto out = make<float>({features.shape(0)});
    kernel().evaluate_driving(*policy.driving_network, features.data(), static_cast<long>(features.shape(0)),
                              out.data());
    return out;
}

Orders make_orders(const Map& map, const Traffic& traffic, const Vector<std::uint8_t>& cooperative,
                   const Vector<std::int8_t>& preferred) {
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    if (cooperative.size() != traffic.route.size() || preferred.size() != pairs.size()) {
        throw std::invalid_argument("cooperative takes one flag a vehicle, preferred one direction a pair");
    }
    return {map, traffic, pairs, {cooperative.data(), cooperative.size()}, {preferred.data(), preferred.size()}};
}

} // namespace

NB_MODULE(_core, m) {
    m.doc() = "The C++ core: maps, conflicts, crossing orders, prediction.";
    nb::exception<FormatError>(m, "FormatError", PyExc_ValueError);
    m.attr("DT") = DT;
    m.attr("STEPS") = STEPS;
    m.attr("MAX_VEHICLES") = MAX_VEHICLES;
    m.attr("BRAKING") = BRAKING;
    m.attr("LEAST_SIZE") = LEAST_SIZE;
    m.attr("MOST_LENGTH") = MOST_LENGTH;
    m.attr("MOST_WIDTH") = MOST_WIDTH;
    m.attr("MOST_SPEED") = MOST_SPEED;
    m.def("available_kernels", &available_kernels, "The instruction sets of this machine's kernels, best last.");
    m.def(
        "gap_features", [] { return std::vector<std::string>(GAP_FEATURES.begin(), GAP_FEATURES.end()); },
        "The gap network's inputs, by name and unit.");
    m.def(
        "driving_features", [] { return std::vector<std::string>(DRIVING_FEATURES.begin(), DRIVING_FEATURES.end()); },
        "The driving network's inputs, by name and unit.");
    m.def("kernel_name", [] { return kernel().name; }, "The kernel in use.");

    nb::class_<Route>(m, "Route")
        .def_ro("id", &Route::id)
        .def_ro("length", &Route::length)
        .def_ro("stop_line", &Route::stop_line)
        .def_ro("stop_lane", &Route::stop_lane)
        .def_prop_ro("junction", [](const Route& r) { return std::make_tuple(r.junction.begin, r.junction.end); })
        .def_ro("first_conflict", &Route::first_conflict)
        .def_prop_ro("sample_count", [](const Route& r) { return r.samples.size(); });

    nb::class_<Map>(m, "Map")
        .def(nb::new_([](std::string text, std::string where) {
                 return std::make_shared<Map>(Map::parse(std::move(text), std::move(where)));
             }),
             "text"_a, "where"_a, "Reads the text of a compiled map, named `where` in errors; raises FormatError.")
        .def_ro("name", &Map::name)
        .def_ro("locations", &Map::locations)
        .def_ro("spacing", &Map::spacing)
        .def_ro("checksum", &Map::checksum)
        .def_ro("heading_offsets", &Map::heading_offsets)
        .def_ro("routes", &Map::routes, nb::rv_policy::reference_internal)
        .def_prop_ro("conflicts", &conflict_rows,
                     "Rows of yielder, prioritized, merging, and the interval on each [m].")
        .def_prop_ro("shared_lanes", &shared_lane_rows, "Rows of a, b, split, merge on a, merge on b, offset [m].")
        .def("sample", &sample, "route"_a, "position"_a.noconvert(),
             "(position, 11): x, y, heading, width, v_max, six relative headings, interpolated.");

    nb::class_<Traffic>(m, "Traffic", "The vehicles at one moment, checked.")
        .def(nb::new_([](const Map& map, const Vector<int>& route, const Vector<float>& position,
                         const Vector<float>& speed, const Vector<float>& length, const Vector<float>& width,
                         const Vector<float>& max_speed) {
                 return make_traffic(map, route, position, speed, length, width, max_speed);
             }),
             "map"_a, "route"_a.noconvert(), "position"_a.noconvert(), "speed"_a.noconvert(), "length"_a.noconvert(),
             "width"_a.noconvert(), "max_speed"_a.noconvert());

    m.def(
        "conflicts", [](const Map& map, const Traffic& t) { return as_array(find_conflicts(map, t)); }, "map"_a,
        "traffic"_a, "(pair, 2): yielder and prioritized vehicle of every open pair.");
    m.def(
        "lane_order", [](const Map& map, const Traffic& t) { return as_array(lane_order(map, t)); }, "map"_a,
        "traffic"_a, "(arc, 2): a vehicle before its stop line, and the next behind it in that lane.");
    m.def(
        "committed",
        [](const Map& map, const Traffic& t) {
            const auto flags = committed(map, t);
            auto array = make<bool>({flags.size()});
            std::copy(flags.begin(), flags.end(), array.data());
            return array;
        },
        "map"_a, "traffic"_a, "(vehicle,): past stopping at its line.");
    m.def(
        "closest",
        [](const Map& map, const Traffic& t) -> std::optional<std::tuple<float, int, int>> {
            const auto found = closest(map, t);
            return found ? std::optional(std::make_tuple(found->distance, found->a, found->b)) : std::nullopt;
        },
        "map"_a, "traffic"_a, "The smallest distance between two vehicles [m] and their indices, or None.");
    m.def(
        "complete",
        [](const Map& map, const Traffic& traffic, const Table<std::int8_t>& assignments) {
            const std::vector<Pair> pairs = find_conflicts(map, traffic);
            if (assignments.shape(1) != pairs.size()) {
                throw std::invalid_argument("assignments must be (scenario, " + std::to_string(pairs.size()) + ")");
            }
            auto array = make<std::int8_t>({assignments.shape(0), pairs.size()});
            std::copy(assignments.data(), assignments.data() + assignments.size(), array.data());
            for (std::size_t s = 0; s < assignments.shape(0); ++s) {
                complete(map, traffic, pairs, {array.data() + s * pairs.size(), pairs.size()});
            }
            return array;
        },
        "map"_a, "traffic"_a, "assignments"_a.noconvert(),
        "(scenario, pair): the assignments and what they imply; raises ValueError for a contradiction.");

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

    nb::class_<Policy>(m, "Policy")
        .def(nb::new_(
                 [](std::string text, std::string where) { return Policy::parse(std::move(text), std::move(where)); }),
             "text"_a, "where"_a, "Reads the text of a policy file, named `where` in errors; raises FormatError.")
        .def_ro("about", &Policy::about, "Provenance and scores, JSON.")
        .def("evaluate_gap", &evaluate_gap, "features"_a.noconvert(), "(row,): logits of accepting the gap.")
        .def("evaluate_driving", &evaluate_driving, "features"_a.noconvert(),
             "(row,): the driving network's output before its last tanh.");

    nb::class_<Predictor>(m, "Predictor")
        .def(nb::init<std::shared_ptr<const Map>, Policy>(), "map"_a, "policy"_a)
        .def("observe", &observe, "traffic"_a,
             "driving (vehicle, 12) and gap (pair, 4) features, and which pairs' gaps are accepted (pair,).")
        .def("predict", &predict, "traffic"_a, "assignments"_a.noconvert(), "trajectories"_a, "safety"_a,
             "decisions"_a.noconvert().none() = nb::none(), "isa"_a = nb::none(),
             "position, speed, acceleration, enters, present, time_loss, minimum_distance.");
}
