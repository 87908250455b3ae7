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
        if (other == route || !map.overlaps_of(route, other).empty()) {
            (other < 16 ? low : high) |= 1 << (other % 16);
        }
    }
    return {r.stop_line,
            r.length,
            r.first_conflict,
            static_cast<float>(first_row),
            static_cast<float>(r.samples.size() - 1),
            static_cast<float>(r.rank * MOST_ROUTES_OF_A_MAP + r.stop_lane),
            static_cast<float>(low),
            static_cast<float>(high)};
}

// What one of two routes has of the other: the conflicts in which it yields and in which the other one does, and the
// lanes that they share, as it sees them.
struct Between {
    std::vector<const Conflict*> conflicts;
    std::vector<SharedLane> lanes;

    Between(const Map& map, int own, int other) {
        for (const Conflict* conflict : {map.conflict(own, other), map.conflict(other, own)}) {
            if (conflict != nullptr) {
                conflicts.push_back(conflict);
            }
        }
        for (const SharedLane& lane : map.shared_lanes_of(own, other)) {
            lanes.push_back(lane.seen_from(own));
        }
        if (own == other) {
            lanes.push_back({own, other, -FAR, -FAR, FAR, 0.0F});
        }
    }
};

const Interval& on(const Conflict& conflict, int route) {
    return conflict.yielder == route ? conflict.on_yielder : conflict.on_prioritized;
}

float kind(const Conflict& conflict, int own) {
    return (conflict.merging ? 2.0F : 1.0F) * (conflict.yielder == own ? 1.0F : -1.0F);
}

// Whether PAIR_COLUMNS say all that there is between two routes.
bool is_plain(const Map& map, const Between& between) {
    if (between.conflicts.empty()) {
        return between.lanes.empty() || (between.lanes.size() == 1 && between.lanes[0].begin_a <= -FAR &&
                                         between.lanes[0].begin_b <= -FAR && between.lanes[0].offset == 0.0F);
    }
    const Conflict& one = *between.conflicts[0];
    if (between.conflicts.size() > 1 || one.by_arrival || one.line != map.routes[at(one.prioritized)].stop_line) {
        return false;
    }
    const bool merges = between.lanes.size() == 1 &&
                        between.lanes[0].end >= map.routes[at(between.lanes[0].a)].length && // nobody reaches its end
                        on(one, between.lanes[0].a).end == between.lanes[0].begin_a &&
                        on(one, between.lanes[0].b).end == between.lanes[0].begin_b;
    return one.merging ? merges : between.lanes.empty();
}

std::vector<float> pair_row(const Between& between, int own, int other) {
    if (between.conflicts.empty()) {
        return between.lanes.empty() ? std::vector{0.0F, 0.0F, 0.0F, 0.0F}
                                     : std::vector{0.0F, 0.0F, between.lanes[0].end, SHARED_ENTRY};
    }
    const Conflict& conflict = *between.conflicts[0];
    const float offset = conflict.merging ? between.lanes[0].offset : 0.0F;
    return {on(conflict, own).end, on(conflict, other).end, offset, kind(conflict, own)};
}

std::vector<float> link_row(const Between& between, std::size_t k, int own, int other) {
    std::vector<float> row{0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, -FAR, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F};
    if (k < between.conflicts.size()) {
        const Conflict& conflict = *between.conflicts[k];
        row[0] = on(conflict, own).end;
        row[1] = on(conflict, other).end;
        row[2] = kind(conflict, own);
        row[3] = conflict.line;
        row[8] = conflict.by_arrival ? 1.0F : 0.0F;
    }
    if (k < between.lanes.size()) {
        const SharedLane& lane = between.lanes[k];
        row[4] = lane.begin_b;
        row[5] = lane.begin_a;
        row[6] = lane.end;
        row[7] = lane.offset;
    }
    return row;
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
        stops_ |= map_->routes[at(route)].must_stop ? 1U << route : 0U;
    }
    add_pairs();
}

void MapTables::add_pairs() {
    const int count = static_cast<int>(map_->routes.size());
    bool plain = true;
    for (int own = 0; own < count; ++own) {
        for (int other = 0; other < count; ++other) {
            plain = plain && is_plain(*map_, Between(*map_, own, other));
        }
    }
    link_count_ = plain ? 0 : MOST_LINKS;
    for (int own = 0; own < count; ++own) {
        for (int other = 0; other < count; ++other) {
            const Between between(*map_, own, other);
            if (plain) {
                const std::vector<float> row = pair_row(between, own, other);
                pairs_.insert(pairs_.end(), row.begin(), row.end());
            }
            for (int k = 0; k < link_count_; ++k) {
                const std::vector<float> row = link_row(between, at(k), own, other);
                links_.insert(links_.end(), row.begin(), row.end());
            }
        }
    }
}

MapRows MapTables::rows() const {
    const float *pairs = link_count_ == 0 ? pairs_.data() : nullptr,
                *links = link_count_ == 0 ? nullptr : links_.data();
    return {map_.get(), route_tables_.observed.data(),         points_.data(), routes_.data(), pairs,
            links,      static_cast<int>(map_->routes.size()), link_count_,    stops_,         1.0F / map_->spacing};
}

} // namespace intersection_env
