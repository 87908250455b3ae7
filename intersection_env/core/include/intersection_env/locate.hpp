// Where on which route something is, from where it is on the ground.
#pragma once

#include <vector>

#include "intersection_env/map.hpp"

namespace intersection_env {

constexpr double ASIDE = 2.0;      // [m], ours: real drivers cut corners by so much; neighbouring lanes are 2.8 m apart
constexpr double TURNED = 0.785;   // [rad], ours: who heads more than 45 degrees elsewhere goes another way
constexpr double PLAIN_LANE = 3.5; // [m], ours: in a lane of this width or less all of the distance counts

// The nearest place on a route's centreline.
struct Nearest {
    double position; // arc length [m], from 0 to the route's length
    double distance; // [m]
    double excess;   // [m], of the distance, what a lane wider than PLAIN_LANE does not leave free
    bool beside;     // it is no end of the route
};
Nearest nearest(const Map& map, int route, double x, double y);

// A place on a route.
struct Place {
    int route;
    float position; // arc length [m]
    float left;     // lateral offset from the centreline, to the left [m]
    float turn;     // heading less the route's, counter-clockwise, from -pi to pi [rad]
};

struct LocateLimits {
    double aside = ASIDE;   // the largest excess [m]
    double turned = TURNED; // the largest turn to either side [rad]
};

// The routes that fit, the one with the smallest offset first (among equal ones, as where routes share a lane, in their
// order): the place is beside them. Metres and radians, as in the map. Throws std::invalid_argument for what is no
// number.
std::vector<Place> locate(const Map& map, double x, double y, double heading, const LocateLimits& limits = {});

} // namespace intersection_env
