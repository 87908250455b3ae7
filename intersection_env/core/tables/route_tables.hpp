// A lane in which who takes one route may lead who takes another; in the arc length of who follows.
struct LeadLane {
    float begin, end, offset; // as in LeadCandidate
    bool same_stop_lane;
};

// The samples of all routes, row after row, as the kernels read them; and who may lead whom.
#pragma once

#include <span>
#include <vector>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"

namespace intersection_env {

struct RouteTables {
    explicit RouteTables(const Map& map, const IdmParameters& idm = {});

    // The lanes in which `other` may lead `route`.
    std::span<const LeadLane> lead_lanes_of(int route, int other) const {
        const std::size_t pair = static_cast<std::size_t>(route) * first_row.size() + static_cast<std::size_t>(other);
        return {lead_lanes.data() + first_lane[pair], lead_lanes.data() + first_lane[pair + 1]};
    }

    std::vector<int> first_row;  // (route,)
    std::vector<float> observed; // (row, OBSERVED_COLUMNS): the IDM's free speed, v_max, six relative headings
    std::vector<float> pose;     // (row, POSE_COLUMNS): x, y, heading, 0
    std::vector<LeadLane> lead_lanes;
    std::vector<std::size_t> first_lane; // (route, other route), and one more: its first lane
};

} // namespace intersection_env
