// The samples of all routes, row after row, as the kernels read them.
#pragma once

#include <vector>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"

namespace intersection_env {

struct RouteTables {
    explicit RouteTables(const Map& map, const IdmParameters& idm = {});

    std::vector<int> first_row;  // (route,)
    std::vector<float> observed; // (row, OBSERVED_COLUMNS): the IDM's free speed, v_max, six relative headings
    std::vector<float> pose;     // (row, POSE_COLUMNS): x, y, heading, 0
};

} // namespace intersection_env
