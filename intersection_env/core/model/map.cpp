#include "intersection_env/map.hpp"

#include <algorithm>

#include "model/ranks.hpp"
#include "model/text_reader.hpp"

namespace intersection_env {
namespace {

constexpr int MAX_SAMPLES = 100000;
constexpr int SAMPLE_COLUMNS = 11;
constexpr int MOST_SHARED = 2, MOST_OVERLAPS = 4; // of two routes

Interval interval(const TextReader& reader, float begin, float end) {
    if (!(begin <= end)) {
        reader.fail("an interval ends before it begins");
    }
    return {begin, end};
}

Route read_route(TextReader& reader) {
    Route route;
    route.id = reader.word("route");
    route.length = reader.floats("length", 1)[0];
    route.stop_line = reader.floats("stop_line", 1)[0];
    route.must_stop = reader.count("must_stop", 0, 1) == 1;
    route.stop_lane = static_cast<int>(reader.count("stop_lane", 0, MOST_ROUTES_OF_A_MAP - 1));
    const std::vector<float> junction = reader.floats("junction", 2);
    route.junction = interval(reader, junction[0], junction[1]);
    route.first_conflict = reader.floats("first_conflict", 1)[0];
    const std::int64_t samples = reader.count("samples", 2, MAX_SAMPLES);
    for (std::int64_t k = 0; k < samples; ++k) {
        const std::vector<float> row = reader.floats("", SAMPLE_COLUMNS);
        Sample sample{row[0], row[1], row[2], row[3], row[4], {}};
        std::copy_n(row.begin() + 5, 6, sample.relative_heading.begin());
        if (!(sample.v_max > 0.0F)) {
            reader.fail("v_max must be positive");
        }
        route.samples.push_back(sample);
    }
    return route;
}

} // namespace

Map Map::read(const std::string& path) { return parse(read_file(path), path); }

Map Map::parse(std::string text, std::string where) {
    TextReader reader(std::move(text), std::move(where), "intersection_env map", 2, 2,
                      "; compile its source anew: python -m intersection_env.map_compiler SOURCE.json OUT.map");
    Map map;
    map.checksum = reader.checksum();
    map.name = reader.word("name");
    for (const float value : reader.counted_floats("locations", 1000)) {
        map.locations.push_back(reader.whole(value, 0, 1000000));
    }
    map.spacing = reader.floats("spacing", 1)[0];
    if (!(map.spacing > 0.0F)) {
        reader.fail("spacing must be positive");
    }
    map.heading_offsets = reader.counted_floats("heading_offsets", 6);
    if (map.heading_offsets.size() != 6) {
        reader.fail("six heading offsets were expected");
    }
    const std::int64_t routes = reader.count("routes", 1, MOST_ROUTES_OF_A_MAP);
    for (std::int64_t k = 0; k < routes; ++k) {
        map.routes.push_back(read_route(reader));
        const Route& route = map.routes.back();
        const float covered = map.spacing * static_cast<float>(route.samples.size() - 1);
        if (!(route.length > 0.0F) || covered < route.length - 1e-3F || covered > route.length + map.spacing) {
            reader.fail("the samples of route \"" + route.id + "\" do not cover its length");
        }
        if (!(route.stop_line >= 0.0F && route.stop_line <= route.length)) {
            reader.fail("the stop line of route \"" + route.id + "\" does not lie on it");
        }
        for (std::size_t other = 0; other + 1 < map.routes.size(); ++other) {
            if (map.routes[other].id == route.id) {
                reader.fail("two routes are named \"" + route.id + "\"");
            }
        }
    }
    const int last = static_cast<int>(routes) - 1;
    const std::int64_t pairs = routes * routes;
    for (std::int64_t k = reader.count("conflicts", 0, pairs); k > 0; --k) {
        const std::vector<float> row = reader.floats("", 9);
        map.conflicts.push_back({reader.whole(row[0], 0, last), reader.whole(row[1], 0, last),
                                 reader.whole(row[2], 0, 1) == 1, reader.whole(row[3], 0, 1) == 1,
                                 interval(reader, row[4], row[5]), interval(reader, row[6], row[7]), row[8]});
    }
    for (std::int64_t k = reader.count("shared_lanes", 0, MOST_SHARED * pairs); k > 0; --k) {
        const std::vector<float> row = reader.floats("", 6);
        map.shared_lanes.push_back(
            {reader.whole(row[0], 0, last), reader.whole(row[1], 0, last), row[2], row[3], row[4], row[5]});
    }
    for (std::int64_t k = reader.count("overlaps", 0, MOST_OVERLAPS * pairs); k > 0; --k) {
        const std::vector<float> row = reader.floats("", 6);
        map.overlaps.push_back({reader.whole(row[0], 0, last), reader.whole(row[1], 0, last),
                                interval(reader, row[2], row[3]), interval(reader, row[4], row[5])});
    }
    reader.finish();
    map.index(reader);
    return map;
}

void Map::index(const TextReader& reader) {
    const std::size_t count = routes.size();
    // Where the rows of each pair stand: together, and in one order of the two.
    const auto build = [count, &reader](auto& table, const auto& rows, int most, auto first, auto second) {
        table.assign(count * count, {0, 0});
        for (int k = 0; k < static_cast<int>(rows.size()); ++k) {
            const auto& row = rows[static_cast<std::size_t>(k)];
            const int a = first(row), b = second(row);
            Rows& own = table[static_cast<std::size_t>(a) * count + static_cast<std::size_t>(b)];
            own = own.count == 0 ? Rows{k, 1} : Rows{own.first, own.count + 1};
            if (a == b || own.count > most || k + 1 != own.first + own.count) {
                reader.fail("two different routes make a pair, and each pair stands together in a table, at most " +
                            std::to_string(most) + " times");
            }
        }
    };
    const auto a = [](const auto& row) { return row.a; };
    const auto b = [](const auto& row) { return row.b; };
    build(
        conflict_rows_, conflicts, 1, [](const Conflict& c) { return c.yielder; },
        [](const Conflict& c) { return c.prioritized; });
    build(shared_rows_, shared_lanes, MOST_SHARED, a, b);
    build(overlap_rows_, overlaps, MOST_OVERLAPS, a, b);
    for (std::size_t one = 0; one < count; ++one) {
        for (std::size_t other = 0; other < count; ++other) {
            for (std::vector<Rows>* table : {&shared_rows_, &overlap_rows_}) {
                const Rows &here = (*table)[one * count + other], &there = (*table)[other * count + one];
                if (one < other && here.count > 0 && there.count > 0) {
                    reader.fail("a pair of routes stands in both orders in a table");
                }
            }
        }
    }
    has_stops_ = std::ranges::any_of(routes, &Route::must_stop);
    rank_routes(*this);
}

Sample Map::at(int route, float position) const {
    const std::vector<Sample>& samples = routes[static_cast<std::size_t>(route)].samples;
    const float x = std::clamp(position / spacing, 0.0F, static_cast<float>(samples.size() - 1));
    const std::size_t k = std::min(static_cast<std::size_t>(x), samples.size() - 2);
    const float f = x - static_cast<float>(k);
    const Sample &p = samples[k], &q = samples[k + 1];
    const auto mix = [f](float from, float to) { return from + f * (to - from); };
    Sample result{mix(p.x, q.x),         mix(p.y, q.y),         mix(p.heading, q.heading),
                  mix(p.width, q.width), mix(p.v_max, q.v_max), {}};
    for (std::size_t n = 0; n < 6; ++n) {
        result.relative_heading[n] = mix(p.relative_heading[n], q.relative_heading[n]);
    }
    return result;
}

namespace {

template <class Row, class Rows>
std::span<const Row> found(const std::vector<Row>& rows, const std::vector<Rows>& table, std::size_t count, int a,
                           int b) {
    const std::size_t i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    const Rows& own = table[i * count + j].count > 0 ? table[i * count + j] : table[j * count + i];
    return {rows.data() + own.first, static_cast<std::size_t>(own.count)};
}

} // namespace

const Conflict* Map::conflict(int yielder, int prioritized) const {
    const Rows& own =
        conflict_rows_[static_cast<std::size_t>(yielder) * routes.size() + static_cast<std::size_t>(prioritized)];
    return own.count == 0 ? nullptr : &conflicts[static_cast<std::size_t>(own.first)];
}

std::span<const SharedLane> Map::shared_lanes_of(int a, int b) const {
    return found(shared_lanes, shared_rows_, routes.size(), a, b);
}

std::span<const Overlap> Map::overlaps_of(int a, int b) const {
    return found(overlaps, overlap_rows_, routes.size(), a, b);
}

} // namespace intersection_env
