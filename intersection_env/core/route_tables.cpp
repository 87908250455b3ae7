#include "route_tables.hpp"

#include "problem.hpp"

namespace intersection_env {

RouteTables::RouteTables(const Map& map) {
    for (const Route& route : map.routes) {
        first_row.push_back(static_cast<int>(pose.size()) / POSE_COLUMNS);
        for (const Sample& sample : route.samples) {
            observed.push_back(sample.v_max);
            observed.insert(observed.end(), sample.relative_heading.begin(), sample.relative_heading.end());
            observed.push_back(0.0F);
            pose.insert(pose.end(), {sample.x, sample.y, sample.heading, 0.0F});
        }
    }
}

} // namespace intersection_env
