#include "tables/map_tables.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "tables/problem.hpp"

namespace intersection_env {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

std::vector<float> route_row(const Map& map, int route, int first_row) {
    const Route& r = map.routes[at(route)];
    int low = 0, high = 0;
    for (int other = 0; other < static_cast<int>(map.routes.size()); ++other) {
        if (other == route || map.overlap(route, other) != nullptr) {
            (other < 16 ? low : high) |= 1 << (other % 16);
        }
    }
    return {r.stop_line,
            r.length,
            r.first_conflict,
            static_cast<float>(first_row),
            static_cast<float>(r.samples.size() - 1),
            static_cast<float>(r.stop_lane),
            static_cast<float>(low),
            static_cast<float>(high)};
}

std::vector<float> pair_row(const Map& map, int own, int other) {
    const SharedLane* shared = map.shared_lane(own, other);
    if (own == other || (shared != nullptr && shared->split > 0.0F)) {
        return {0.0F, 0.0F, own == other ? FAR : shared->split, SHARED_ENTRY};
    }
    const Conflict* conflict = map.conflict(own, other);
    if (shared != nullptr && (conflict == nullptr || !conflict->merging)) {
        throw std::invalid_argument("map \"" + map.name + "\": routes " + map.routes[at(own)].id + " and " +
                                    map.routes[at(other)].id + " merge without a merging conflict");
    }
    if (conflict == nullptr) {
        return {0.0F, 0.0F, 0.0F, 0.0F};
    }
    const bool yields = conflict->yielder == own;
    const Interval& on_own = yields ? conflict->on_yielder : conflict->on_prioritized;
    const Interval& on_other = yields ? conflict->on_prioritized : conflict->on_yielder;
    float offset = 0.0F;
    if (conflict->merging) {
        const bool in_order = shared != nullptr && shared->a == own;
        if (shared == nullptr || on_own.end != (in_order ? shared->merge_a : shared->merge_b) ||
            on_other.end != (in_order ? shared->merge_b : shared->merge_a)) {
            throw std::invalid_argument("map \"" + map.name + "\": the merging conflict of routes " +
                                        map.routes[at(own)].id + " and " + map.routes[at(other)].id +
                                        " does not end where they merge");
        }
        offset = in_order ? shared->offset : -shared->offset;
    }
    return {on_own.end, on_other.end, offset, (conflict->merging ? 2.0F : 1.0F) * (yields ? 1.0F : -1.0F)};
}

} // namespace

MapTables::MapTables(std::shared_ptr<const Map> map) : map_(std::move(map)), route_tables_(*map_) {
    const int count = static_cast<int>(map_->routes.size());
    if (count > MOST_ROUTES_OF_WORLDS) {
        throw std::invalid_argument("map \"" + map_->name + "\" has " + std::to_string(count) +
                                    " routes; worlds take at most " + std::to_string(MOST_ROUTES_OF_WORLDS));
    }
    for (int route = 0; route < count; ++route) {
        const std::vector<float> row = route_row(*map_, route, route_tables_.first_row[at(route)]);
        routes_.insert(routes_.end(), row.begin(), row.end());
        const std::vector<Sample>& samples = map_->routes[at(route)].samples;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            const Sample &sample = samples[k], &next = samples[std::min(k + 1, samples.size() - 1)];
            points_.insert(points_.end(), {sample.x, sample.y, next.x - sample.x, next.y - sample.y});
        }
        for (int other = 0; other < count; ++other) {
            const std::vector<float> pair = pair_row(*map_, route, other);
            pairs_.insert(pairs_.end(), pair.begin(), pair.end());
        }
    }
}

MapRows MapTables::rows() const {
    return {map_.get(),    route_tables_.observed.data(),         points_.data(),      routes_.data(),
            pairs_.data(), static_cast<int>(map_->routes.size()), 1.0F / map_->spacing};
}

} // namespace intersection_env
