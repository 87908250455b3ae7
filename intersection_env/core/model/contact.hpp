// Whether two vehicles collide, and who is to blame.
#pragma once

#include "intersection_env/map.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

constexpr float COLLISION_DISTANCE = 0.5F; // [m], paper, Table II, row 9

// A vehicle on its route: arc length of the centre [m], size [m].
struct Body {
    int route;
    float position, length, width;
    std::int32_t waited = 0; // as in Traffic

    float front() const { return position + 0.5F * length; }
    float rear() const { return position - 0.5F * length; }
};

Body body(const Traffic& traffic, int vehicle);

// The sample at an arc length; beyond its end a route goes straight on.
Sample straight_on(const Map& map, int route, float position);

// Between their rectangles [m], 0 where they overlap; NO_DISTANCE where they cannot touch.
float clearance(const Map& map, const Body& a, const Body& b);

// As the worlds see it: the borders of their circles are nearer than COLLISION_DISTANCE now, or once both have braked,
// which takes them `braking_a` and `braking_b` metres.
bool collide(const Map& map, const Body& a, const Body& b, float braking_a, float braking_b);

// The conflict that one of two vehicles yields in and is before its PGA of; the nearer PGA's where both are. Null if
// there is none.
const Conflict* conflict_before_pga(const Map& map, const Body& a, const Body& b);

// By right of way, then by the order in the lane; both where neither says anything.
struct Blame {
    bool a, b;
};
Blame to_blame(const Map& map, const Body& a, const Body& b);

} // namespace intersection_env
