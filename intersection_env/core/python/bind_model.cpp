// Maps, and the vehicles on them.
#include "python/bind.hpp"

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "intersection_env/locate.hpp"
#include "intersection_env/map.hpp"
#include "intersection_env/traffic.hpp"
#include "python/arrays.hpp"

namespace intersection_env::python {

using namespace nb::literals;

namespace {

Traffic make_traffic(const Map& map, const Vector<int>& route, const Vector<float>& position,
                     const Vector<float>& speed, const Vector<float>& length, const Vector<float>& width,
                     const Vector<float>& max_speed, const std::optional<Vector<bool>>& delta,
                     const std::optional<Vector<std::int16_t>>& hold, const std::optional<Vector<std::int32_t>>& waited,
                     const std::optional<Vector<float>>& patience) {
    Traffic traffic{copy(route), copy(position), copy(speed), copy(length), copy(width), copy(max_speed)};
    if (delta) {
        traffic.delta.assign(delta->data(), delta->data() + delta->size());
    }
    if (hold) {
        traffic.hold.assign(hold->data(), hold->data() + hold->size());
    }
    if (waited) {
        traffic.waited.assign(waited->data(), waited->data() + waited->size());
    }
    if (patience) {
        traffic.patience.assign(patience->data(), patience->data() + patience->size());
    }
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

std::vector<std::tuple<int, int, bool, bool, float, float, float, float, float>> conflict_rows(const Map& map) {
    std::vector<std::tuple<int, int, bool, bool, float, float, float, float, float>> rows;
    for (const Conflict& c : map.conflicts) {
        rows.emplace_back(c.yielder, c.prioritized, c.merging, c.by_arrival, c.on_yielder.begin, c.on_yielder.end,
                          c.on_prioritized.begin, c.on_prioritized.end, c.line);
    }
    return rows;
}

std::vector<std::tuple<int, int, float, float, float, float>> shared_lane_rows(const Map& map) {
    std::vector<std::tuple<int, int, float, float, float, float>> rows;
    for (const SharedLane& s : map.shared_lanes) {
        rows.emplace_back(s.a, s.b, s.begin_a, s.begin_b, s.end, s.offset);
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

using Doubles = nb::ndarray<nb::numpy, double>;

// Of each point, the nearest place on a route.
std::tuple<Doubles, Doubles, Doubles> project(const Map& map, int route, const Matrix<double>& points) {
    if (route < 0 || static_cast<std::size_t>(route) >= map.routes.size()) {
        throw nb::index_error("no such route");
    }
    if (points.shape(1) != 2) {
        throw std::invalid_argument("points must be (point, 2)");
    }
    auto position = make<double>({points.shape(0)}), distance = make<double>({points.shape(0)});
    auto excess = make<double>({points.shape(0)});
    for (std::size_t k = 0; k < points.shape(0); ++k) {
        const Nearest place = nearest(map, route, points.data()[2 * k], points.data()[2 * k + 1]);
        position.data()[k] = place.position;
        distance.data()[k] = place.distance;
        excess.data()[k] = place.excess;
    }
    return {position, distance, excess};
}

std::vector<std::tuple<int, float, float, float>> places(const Map& map, double x, double y, double heading,
                                                         double aside, double turned) {
    std::vector<std::tuple<int, float, float, float>> rows;
    for (const Place& place : locate(map, x, y, heading, {aside, turned})) {
        rows.emplace_back(place.route, place.position, place.left, place.turn);
    }
    return rows;
}

} // namespace

void bind_model(nb::module_& m) {
    nb::class_<Route>(m, "Route")
        .def_ro("id", &Route::id)
        .def_ro("length", &Route::length)
        .def_ro("stop_line", &Route::stop_line)
        .def_ro("must_stop", &Route::must_stop)
        .def_ro("stop_lane", &Route::stop_lane)
        .def_ro("rank", &Route::rank)
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
                     "Rows of yielder, prioritized, merging, by arrival, the interval on each, and the line [m].")
        .def_prop_ro("shared_lanes", &shared_lane_rows, "Rows of a, b, begin on a, begin on b, end on a, offset [m].")
        .def_prop_ro("has_stops", &Map::has_stops, "Whether somebody has to make a stop.")
        .def("sample", &sample, "route"_a, "position"_a.noconvert(),
             "(position, 11): x, y, heading, width, v_max, six relative headings, interpolated.")
        .def("project", &project, "route"_a, "points"_a.noconvert(),
             "Of points (point, 2) the nearest places on a route: position, distance, excess (point,) [m].")
        .def("locate", &places, "x"_a, "y"_a, "heading"_a, "aside"_a, "turned"_a,
             "The routes that fit: rows of route, position, lateral offset [m] and turn [rad].");

    nb::class_<Traffic>(m, "Traffic", "The vehicles at one moment, checked.")
        .def(nb::new_(&make_traffic), "map"_a, "route"_a.noconvert(), "position"_a.noconvert(), "speed"_a.noconvert(),
             "length"_a.noconvert(), "width"_a.noconvert(), "max_speed"_a.noconvert(),
             "delta"_a.noconvert().none() = nb::none(), "hold"_a.noconvert().none() = nb::none(),
             "waited"_a.noconvert().none() = nb::none(), "patience"_a.noconvert().none() = nb::none());

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
        "map"_a, "traffic"_a, "(vehicle,): goes, and is past stopping at its line.");
    m.def(
        "closest",
        [](const Map& map, const Traffic& t) -> std::optional<std::tuple<float, int, int>> {
            const auto found = closest(map, t);
            return found ? std::optional(std::make_tuple(found->distance, found->a, found->b)) : std::nullopt;
        },
        "map"_a, "traffic"_a, "The smallest distance between two vehicles [m] and their indices, or None.");
    m.def("overlaps", &overlaps, "map"_a, "traffic"_a, "Pairs of vehicles whose bodies overlap.");
    m.def("doubted_speeds", &doubted_speeds, "map"_a, "traffic"_a,
          "The vehicles that are faster than anybody drives there: km/h for m/s.");
    m.def("collision", &collision, "map"_a, "traffic"_a, "bodies"_a = "circles",
          "The first two vehicles that collide, now or once both have braked fully, or None.");
}

} // namespace intersection_env::python
