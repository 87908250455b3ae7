#include "tables/route_tables.hpp"

#include <algorithm>
#include <cmath>

#include "tables/problem.hpp"

namespace intersection_env {
namespace {

// How fast the IDM goes at each sample of a route where nobody is ahead; curvature is taken over the 6 m around it.
std::vector<float> free_speed(const Map& map, const Route& route, const IdmParameters& idm) {
    const auto offset = [&map](float metres) {
        return std::ranges::find(map.heading_offsets, metres) - map.heading_offsets.begin();
    };
    const auto before = static_cast<std::size_t>(offset(-3.0F)), after = static_cast<std::size_t>(offset(3.0F));
    std::vector<float> speed;
    for (const Sample& sample : route.samples) {
        speed.push_back(idm.speed_share * sample.v_max);
        if (idm.lateral_acceleration < NO_CURVES) {
            const float turn = std::abs(sample.relative_heading[after] - sample.relative_heading[before]);
            speed.back() = std::min(speed.back(), std::sqrt(idm.lateral_acceleration * 6.0F / std::max(turn, 1e-4F)));
        }
    }
    if (idm.lateral_acceleration < NO_CURVES) {
        for (std::size_t k = speed.size() - 1; k > 0; --k) {
            const float ahead = speed[k];
            speed[k - 1] = std::min(speed[k - 1], std::sqrt(ahead * ahead + 2.0F * idm.deceleration * map.spacing));
        }
    }
    return speed;
}

void add_lead_lanes(const Map& map, int route, int other, std::vector<LeadLane>& lanes) {
    if (route == other) {
        lanes.push_back({-FAR, FAR, 0.0F, true});
        return;
    }
    const auto stop_lane = [&map](int one) { return map.routes[static_cast<std::size_t>(one)].stop_lane; };
    for (const SharedLane& row : map.shared_lanes_of(route, other)) {
        const SharedLane lane = row.seen_from(route);
        lanes.push_back({lane.begin_b, lane.end, lane.offset, stop_lane(route) == stop_lane(other)});
    }
}

} // namespace

RouteTables::RouteTables(const Map& map, const IdmParameters& idm) {
    for (const Route& route : map.routes) {
        first_row.push_back(static_cast<int>(pose.size()) / POSE_COLUMNS);
        const std::vector<float> speeds = free_speed(map, route, idm);
        auto free = speeds.begin();
        for (const Sample& sample : route.samples) {
            observed.insert(observed.end(), {*free++, sample.v_max});
            observed.insert(observed.end(), sample.relative_heading.begin(), sample.relative_heading.end());
            pose.insert(pose.end(), {sample.x, sample.y, sample.heading, 0.0F});
        }
    }
    const int count = static_cast<int>(map.routes.size());
    for (int route = 0; route < count; ++route) {
        for (int other = 0; other < count; ++other) {
            first_lane.push_back(lead_lanes.size());
            add_lead_lanes(map, route, other, lead_lanes);
        }
    }
    first_lane.push_back(lead_lanes.size());
}

} // namespace intersection_env
