// The core as a Python module. Arrays are float32, int32 or int8, C-contiguous, never converted.
#include <algorithm>
#include <cmath>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "intersection_env/maneuvers.hpp"
#include "intersection_env/map.hpp"
#include "intersection_env/orders.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"
#include "kernel/dispatch.hpp"
#include "model/text_reader.hpp"
#include "prediction/predictor.hpp"
#include "worlds/closed_loop.hpp"
#include "worlds/replay.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace intersection_env;

namespace {

template <class T>
using Vector = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Arrays = nb::typed<nb::dict, nb::str, nb::any>; // by name

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

using Doubles = nb::ndarray<nb::numpy, double>;
using Booleans = nb::ndarray<nb::numpy, bool>;

template <class T, class Field>
nb::ndarray<nb::numpy, T> column(const Ranking& ranking, Field Maneuver::* field) {
    auto array = make<T>({ranking.maneuvers.size()});
    std::transform(ranking.maneuvers.begin(), ranking.maneuvers.end(), array.data(),
                   [field](const Maneuver& maneuver) { return static_cast<T>(maneuver.*field); });
    return array;
}

std::tuple<Arrays, std::size_t> rank(const Predictor& predictor, const Traffic& traffic,
                                     const Vector<std::uint8_t>& cooperative, std::optional<std::size_t> limit) {
    Ranking ranking;
    {
        const nb::gil_scoped_release release;
        ranking = rank_maneuvers(predictor, traffic, {cooperative.data(), cooperative.size()}, limit, kernel());
    }
    auto priorities = make<std::int8_t>({ranking.maneuvers.size(), ranking.pairs.size()});
    std::copy(ranking.priorities.begin(), ranking.priorities.end(), priorities.data());
    Arrays columns;
    columns["total_time_loss"] = column<double>(ranking, &Maneuver::total_time_loss);
    columns["worst_time_loss"] = column<double>(ranking, &Maneuver::worst_time_loss);
    columns["gain"] = column<double>(ranking, &Maneuver::gain);
    columns["worth_executing"] = column<bool>(ranking, &Maneuver::worth_executing);
    columns["minimum_distance"] = column<double>(ranking, &Maneuver::minimum_distance);
    columns["safe"] = column<bool>(ranking, &Maneuver::safe);
    columns["intervention"] = column<bool>(ranking, &Maneuver::intervention);
    columns["priorities"] = priorities;
    return {columns, ranking.left_out};
}

nb::ndarray<nb::numpy, std::int8_t>
order_of(const Map& map, const Traffic& traffic,
         const nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>& position) {
    if (position.shape(1) != STEPS + 1 || position.shape(2) != traffic.route.size()) {
        throw std::invalid_argument("position must be (scenario, " + std::to_string(STEPS + 1) + ", vehicle)");
    }
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    const std::vector<std::int8_t> order = crossing_order(map, traffic, pairs, position.data(), position.shape(0));
    auto array = make<std::int8_t>({position.shape(0), pairs.size()});
    std::copy(order.begin(), order.end(), array.data());
    return array;
}

std::vector<std::string> words_of(const Map& map, const Traffic& traffic, const std::vector<std::string>& names,
                                  const Table<std::int8_t>& orders) {
    const std::vector<Pair> pairs = find_conflicts(map, traffic);
    if (names.size() != traffic.route.size() || orders.shape(1) != pairs.size()) {
        throw std::invalid_argument("names take one entry a vehicle, orders (order, " + std::to_string(pairs.size()) +
                                    ")");
    }
    return in_words(map, traffic, pairs, names, orders.data(), orders.shape(0));
}

// A view of memory that its owner, a bound object, keeps.
template <class T>
nb::ndarray<nb::numpy, T> view(nb::handle owner, T* data, std::initializer_list<int> shape) {
    std::vector<std::size_t> sizes(shape.begin(), shape.end());
    return nb::ndarray<nb::numpy, T>(data, sizes.size(), sizes.data(), owner);
}

nb::ndarray<nb::numpy, bool> flags(nb::handle owner, std::vector<std::uint8_t>& data,
                                   std::initializer_list<int> shape) {
    return view(owner, reinterpret_cast<bool*>(data.data()), shape);
}

template <class T, class Stored>
nb::ndarray<nb::numpy, T> copied(const std::vector<Stored>& values, std::initializer_list<int> shape) {
    auto array = make<T>(std::vector<std::size_t>(shape.begin(), shape.end()));
    std::copy(values.begin(), values.end(), array.data());
    return array;
}

// One array of a state, by name; its size is checked by whoever takes the state.
template <class T, class Stored>
void take(const Arrays& state, const char* name, std::vector<Stored>& values) {
    using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
    Array array;
    if (!state.contains(name) || !nb::try_cast<Array>(state[name], array, false)) {
        throw std::invalid_argument(std::string("the array \"") + name +
                                    "\" is missing, of another type or not contiguous");
    }
    values.assign(array.data(), array.data() + array.size());
}

Arrays state_of(const ClosedLoop& worlds) {
    const ClosedLoopState s = worlds.state();
    const int count = worlds.worlds(), vehicles = worlds.vehicles();
    Arrays state;
    state["route"] = copied<std::int32_t>(s.route, {count, vehicles});
    state["position"] = copied<float>(s.position, {count, vehicles});
    state["speed"] = copied<float>(s.speed, {count, vehicles});
    state["length"] = copied<float>(s.length, {count, vehicles});
    state["width"] = copied<float>(s.width, {count, vehicles});
    state["max_speed"] = copied<float>(s.max_speed, {count, vehicles});
    state["acceleration"] = copied<float>(s.acceleration, {count, vehicles});
    state["delta"] = copied<bool>(s.delta, {count, vehicles});
    state["hold"] = copied<std::int32_t>(s.hold, {count, vehicles});
    state["cycle"] = copied<std::int32_t>(s.cycle, {count});
    state["done"] = copied<bool>(s.done, {count});
    state["random"] = copied<std::uint32_t>(s.random, {count, 8});
    return state;
}

void restore(ClosedLoop& worlds, const Arrays& state) {
    ClosedLoopState s;
    take<std::int32_t>(state, "route", s.route);
    take<float>(state, "position", s.position);
    take<float>(state, "speed", s.speed);
    take<float>(state, "length", s.length);
    take<float>(state, "width", s.width);
    take<float>(state, "max_speed", s.max_speed);
    take<float>(state, "acceleration", s.acceleration);
    take<bool>(state, "delta", s.delta);
    take<std::int32_t>(state, "hold", s.hold);
    take<std::int32_t>(state, "cycle", s.cycle);
    take<bool>(state, "done", s.done);
    take<std::uint32_t>(state, "random", s.random);
    const nb::gil_scoped_release release;
    worlds.set_state(s);
}

Arrays state_of(const Replay& worlds) {
    const ReplayState s = worlds.state();
    const int count = worlds.worlds();
    Arrays state;
    state["track"] = copied<std::int32_t>(s.track, {count});
    state["time"] = copied<std::int32_t>(s.time, {count});
    state["position"] = copied<float>(s.position, {count});
    state["speed"] = copied<float>(s.speed, {count});
    state["acceleration"] = copied<float>(s.acceleration, {count});
    state["delta"] = copied<bool>(s.delta, {count});
    state["expert_delta"] = copied<bool>(s.expert_delta, {count});
    state["done"] = copied<bool>(s.done, {count});
    state["random"] = copied<std::uint32_t>(s.random, {count, 8});
    return state;
}

void restore(Replay& worlds, const Arrays& state) {
    ReplayState s;
    take<std::int32_t>(state, "track", s.track);
    take<std::int32_t>(state, "time", s.time);
    take<float>(state, "position", s.position);
    take<float>(state, "speed", s.speed);
    take<float>(state, "acceleration", s.acceleration);
    take<bool>(state, "delta", s.delta);
    take<bool>(state, "expert_delta", s.expert_delta);
    take<bool>(state, "done", s.done);
    take<std::uint32_t>(state, "random", s.random);
    const nb::gil_scoped_release release;
    worlds.set_state(s);
}

RecordedScenes scenes_of(const Arrays& arrays) {
    RecordedScenes s;
    take<std::int64_t>(arrays, "scene_tracks", s.scene_tracks);
    take<std::int64_t>(arrays, "track_samples", s.track_samples);
    take<std::int32_t>(arrays, "track_route", s.route);
    take<std::int32_t>(arrays, "track_start", s.start);
    take<float>(arrays, "track_length", s.length);
    take<float>(arrays, "track_width", s.width);
    take<float>(arrays, "track_max_speed", s.max_speed);
    take<float>(arrays, "position", s.position);
    take<float>(arrays, "speed", s.speed);
    take<bool>(arrays, "observed", s.observed);
    return s;
}

int vehicles_of(const ClosedLoop& worlds) { return worlds.vehicles(); }
int vehicles_of(const Replay&) { return 1; }

template <class T>
T* filled_by(const nb::ndarray<T, nb::c_contig, nb::device::cpu>& array, const char* name, std::size_t size) {
    if (array.size() != size) {
        throw std::invalid_argument(std::string("the array \"") + name + "\" of a rollout has the wrong size");
    }
    return array.data();
}

DrivingNetwork network_of(const Vector<float>& parameters, const char* name) {
    DrivingNetwork network;
    if (parameters.size() * sizeof(float) != sizeof(network)) {
        throw std::invalid_argument(std::string(name) + " must have " +
                                    std::to_string(sizeof(network) / sizeof(float)) + " parameters, not " +
                                    std::to_string(parameters.size()));
    }
    std::copy(parameters.data(), parameters.data() + parameters.size(), reinterpret_cast<float*>(&network));
    return network;
}

using Results = nb::ndarray<float, nb::c_contig, nb::device::cpu>;
using ResultFlags = nb::ndarray<bool, nb::c_contig, nb::device::cpu>;

template <class Worlds>
void roll_out(Worlds& worlds, const Vector<float>& policy, const Vector<float>& value, float sigma, int steps,
              const Results& observation, const Results& latent, const Results& log_probability,
              const Results& value_now, const Results& value_next, const Results& reward, const ResultFlags& terminated,
              const ResultFlags& cut) {
    const DrivingNetwork policy_network = network_of(policy, "policy"), value_network = network_of(value, "value");
    if (steps < 1 || !(sigma > 0.0F)) {
        throw std::invalid_argument("a rollout needs at least one step and a sigma above 0");
    }
    const std::size_t size = static_cast<std::size_t>(worlds.worlds()) * static_cast<std::size_t>(steps) *
                             static_cast<std::size_t>(vehicles_of(worlds));
    const Rollout rollout{&policy_network,
                          &value_network,
                          sigma,
                          std::log(sigma),
                          filled_by(observation, "observation", size * DRIVING_INPUTS),
                          filled_by(latent, "latent", size),
                          filled_by(log_probability, "log_probability", size),
                          filled_by(value_now, "value", size),
                          filled_by(value_next, "value_next", size),
                          filled_by(reward, "reward", size),
                          reinterpret_cast<std::uint8_t*>(filled_by(terminated, "terminated", size)),
                          reinterpret_cast<std::uint8_t*>(filled_by(cut, "cut", size))};
    const nb::gil_scoped_release release;
    worlds.rollout(rollout, steps);
}

} // namespace

NB_MODULE(_core, m) {
    m.doc() = "The C++ core: maps, conflicts, crossing orders, prediction.";
    nb::exception<FormatError>(m, "FormatError", PyExc_ValueError);
    m.attr("DT") = DT;
    m.attr("STEPS") = STEPS;
    m.attr("MAX_VEHICLES") = MAX_VEHICLES;
    m.attr("MOST_THREADS") = MOST_THREADS;
    m.attr("BRAKING") = BRAKING;
    m.attr("LEAST_SIZE") = LEAST_SIZE;
    m.attr("MOST_LENGTH") = MOST_LENGTH;
    m.attr("MOST_WIDTH") = MOST_WIDTH;
    m.attr("MOST_SPEED") = MOST_SPEED;
    m.attr("WORTHWHILE_GAIN") = WORTHWHILE_GAIN;
    m.attr("MOST_MANEUVERS") = MOST_MANEUVERS;
    m.attr("MOST_COUNTED") = MOST_COUNTED;
    m.def("available_kernels", &available_kernels, "The instruction sets of this machine's kernels, best last.");
    m.def(
        "gap_features", [] { return std::vector<std::string>(GAP_FEATURES.begin(), GAP_FEATURES.end()); },
        "The gap network's inputs, by name and unit.");
    m.def(
        "driving_features", [] { return std::vector<std::string>(DRIVING_FEATURES.begin(), DRIVING_FEATURES.end()); },
        "The driving network's inputs, by name and unit.");
    m.def(
        "multiply_adds",
        [](const std::string& isa, long rounds) {
            const Kernel& one = kernel_named(isa);
            const nb::gil_scoped_release release;
            return std::make_tuple(12 * one.lanes * rounds, one.multiply_add(rounds));
        },
        "isa"_a, "rounds"_a,
        "Does float32 multiply-adds as fast as this kernel can; how many, and a number they end in.");
    m.def(
        "tanhs",
        [](const std::string& isa, long rounds) {
            const Kernel& one = kernel_named(isa);
            const nb::gil_scoped_release release;
            return std::make_tuple(16 * one.lanes * rounds, one.hyperbolic_tangent(rounds));
        },
        "isa"_a, "rounds"_a, "Likewise tanh.");
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
            auto array = make<bool>({t.route.size()});
            for (int i = 0; i < t.count(); ++i) {
                array.data()[i] = committed(map, t, i);
            }
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
            Completion completion;
            completion.prepare(map, traffic, pairs);
            for (std::size_t s = 0; s < assignments.shape(0); ++s) {
                completion.complete({array.data() + s * pairs.size(), pairs.size()});
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
        .def(nb::init<std::shared_ptr<const Map>, Policy, int>(), "map"_a, "policy"_a, "threads"_a = 1)
        .def("observe", &observe, "traffic"_a,
             "driving (vehicle, 12) and gap (pair, 4) features, and which pairs' gaps are accepted (pair,).")
        .def("predict", &predict, "traffic"_a, "assignments"_a.noconvert(), "trajectories"_a, "safety"_a,
             "decisions"_a.noconvert().none() = nb::none(), "isa"_a = nb::none(),
             "position, speed, acceleration, enters, present, time_loss, minimum_distance.");

    m.def("rank_maneuvers", &rank, "predictor"_a, "traffic"_a, "cooperative"_a.noconvert(), "limit"_a.none(),
          "Every crossing order and no intervention, ranked: columns (maneuver,), priorities (maneuver, pair); and how "
          "many orders were left out.");
    m.def("crossing_order", &order_of, "map"_a, "traffic"_a, "position"_a.noconvert(),
          "(scenario, pair): who reached each conflict first in positions (scenario, time, vehicle).");
    m.def("in_words", &words_of, "map"_a, "traffic"_a, "names"_a, "orders"_a.noconvert(),
          "Orders (order, pair) as sequences of vehicles.");

    auto closed_loop =
        nb::class_<ClosedLoop>(m, "ClosedLoop",
                               "Closed-loop worlds; the arrays are views of what the next step overwrites.")
            .def(
                "__init__",
                [](ClosedLoop* self, std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles,
                   int max_cycles, const std::string& autoreset, int threads, const std::optional<std::string>& isa) {
                    new (self) ClosedLoop(std::move(map), std::move(policy), worlds, vehicles, max_cycles,
                                          autoreset_named(autoreset), threads,
                                          isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
                },
                "map"_a, "policy"_a, "worlds"_a, "vehicles"_a, "max_cycles"_a, "autoreset"_a, "threads"_a,
                "isa"_a = nb::none())
            .def("reset", &ClosedLoop::reset, "seed"_a, "desynchronise"_a, nb::call_guard<nb::gil_scoped_release>())
            .def(
                "reset_worlds",
                [](ClosedLoop& worlds, const Vector<bool>& mask) {
                    const std::vector<std::uint8_t> wanted(mask.data(), mask.data() + mask.size());
                    const nb::gil_scoped_release release;
                    worlds.reset_worlds(wanted);
                },
                "mask"_a.noconvert())
            .def("step", &ClosedLoop::step, nb::call_guard<nb::gil_scoped_release>())
            .def("rollout", &roll_out<ClosedLoop>, "policy"_a.noconvert(), "value"_a.noconvert(), "sigma"_a, "steps"_a,
                 "observation"_a.noconvert(), "latent"_a.noconvert(), "log_probability"_a.noconvert(),
                 "value_now"_a.noconvert(), "value_next"_a.noconvert(), "reward"_a.noconvert(),
                 "terminated"_a.noconvert(), "cut"_a.noconvert(),
                 "Steps with the policy inside; fills arrays (world, step, vehicle[, feature]).")
            .def("state", nb::overload_cast<const ClosedLoop&>(&state_of),
                 "Everything, as arrays (world, vehicle), (world,) and (world, 8).")
            .def("set_state", nb::overload_cast<ClosedLoop&, const Arrays&>(&restore), "state"_a);
    for (const auto& [name, field] :
         {std::pair{"action", &ClosedLoop::action}, std::pair{"reward", &ClosedLoop::reward}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return view(self, (w.*field).data(), {w.worlds(), w.vehicles()});
        });
    }
    for (const auto& [name, field] : {std::pair{"observation", &ClosedLoop::observation},
                                      std::pair{"final_observation", &ClosedLoop::final_observation}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return view(self, (w.*field).data(), {w.worlds(), w.vehicles(), DRIVING_INPUTS});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"terminated", &ClosedLoop::terminated}, std::pair{"truncated", &ClosedLoop::truncated},
          std::pair{"reinserted", &ClosedLoop::reinserted}}) {
        closed_loop.def_prop_ro(name, [field](nb::handle_t<ClosedLoop> self) {
            auto& w = nb::cast<ClosedLoop&>(self);
            return flags(self, w.*field, {w.worlds(), w.vehicles()});
        });
    }
    closed_loop.def_prop_ro("done", [](nb::handle_t<ClosedLoop> self) {
        auto& w = nb::cast<ClosedLoop&>(self);
        return flags(self, w.done, {w.worlds()});
    });

    auto replay =
        nb::class_<Replay>(m, "Replay", "Replay worlds; the arrays are views of what the next step overwrites.");
    replay
        .def(
            "__init__",
            [](Replay* self, std::shared_ptr<const Map> map, Policy policy, bool recording, const Arrays& scenes,
               const Vector<std::int32_t>& actors, int worlds, const std::string& autoreset, int threads,
               const std::optional<std::string>& isa) {
                RecordedScenes recorded = scenes_of(scenes);
                std::vector<std::int32_t> may_act = copy(actors);
                const nb::gil_scoped_release release;
                new (self) Replay(std::move(map), std::move(policy), recording, std::move(recorded), std::move(may_act),
                                  worlds, autoreset_named(autoreset), threads,
                                  isa ? kernel_named(*isa) : kernel_for_worlds(worlds));
            },
            "map"_a, "policy"_a, "recording"_a, "scenes"_a, "actors"_a.noconvert(), "worlds"_a, "autoreset"_a,
            "threads"_a, "isa"_a = nb::none())
        .def("reset", &Replay::reset, "seed"_a, "desynchronise"_a, nb::call_guard<nb::gil_scoped_release>())
        .def(
            "reset_worlds",
            [](Replay& worlds, const Vector<bool>& mask) {
                const std::vector<std::uint8_t> wanted(mask.data(), mask.data() + mask.size());
                const nb::gil_scoped_release release;
                worlds.reset_worlds(wanted);
            },
            "mask"_a.noconvert())
        .def("start", &Replay::start, "world"_a, "track"_a, "Begins this world's episode with this track.")
        .def("step", &Replay::step, nb::call_guard<nb::gil_scoped_release>())
        .def("rollout", &roll_out<Replay>, "policy"_a.noconvert(), "value"_a.noconvert(), "sigma"_a, "steps"_a,
             "observation"_a.noconvert(), "latent"_a.noconvert(), "log_probability"_a.noconvert(),
             "value_now"_a.noconvert(), "value_next"_a.noconvert(), "reward"_a.noconvert(), "terminated"_a.noconvert(),
             "cut"_a.noconvert(), "Steps with the policy inside; fills arrays (world, step[, feature]).")
        .def("state", nb::overload_cast<const Replay&>(&state_of), "Everything, as arrays (world,) and (world, 8).")
        .def("set_state", nb::overload_cast<Replay&, const Arrays&>(&restore), "state"_a);
    for (const auto& [name, field] : {std::pair{"action", &Replay::action}, std::pair{"reward", &Replay::reward},
                                      std::pair{"expert_acceleration", &Replay::expert_acceleration}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds()});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"observation", &Replay::observation}, std::pair{"final_observation", &Replay::final_observation},
          std::pair{"expert_observation", &Replay::expert_observation}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds(), DRIVING_INPUTS});
        });
    }
    for (const auto& [name, field] :
         {std::pair{"terminated", &Replay::terminated}, std::pair{"truncated", &Replay::truncated}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return flags(self, w.*field, {w.worlds()});
        });
    }
    for (const auto& [name, field] : {std::pair{"track", &Replay::track_now}, std::pair{"time", &Replay::time_now}}) {
        replay.def_prop_ro(name, [field](nb::handle_t<Replay> self) {
            auto& w = nb::cast<Replay&>(self);
            return view(self, (w.*field).data(), {w.worlds()});
        });
    }
}
