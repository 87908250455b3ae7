// Whether two vehicles collide, and who is to blame.
#pragma once

#include <cstdint>
#include <string_view>

#include "intersection_env/map.hpp"
#include "intersection_env/traffic.hpp"

namespace intersection_env {

constexpr float COLLISION_DISTANCE = 0.5F; // [m], paper, Table II, row 9

// What stands for a vehicle where worlds look for collisions, if they do: the paper's two circles, or its rectangle.
enum class Bodies : std::uint8_t { unseen, circles, rectangles };

// Throws std::invalid_argument for a name that is none.
Bodies bodies_named(std::string_view name);

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

// As the worlds see it: the borders of their bodies are nearer than COLLISION_DISTANCE now, or once both have braked,
// which takes them `braking_a` and `braking_b` metres.
bool collide(const Map& map, const Body& a, const Body& b, float braking_a, float braking_b, Bodies bodies);

// The conflict that one of two vehicles yields in and is before its PGA of; the nearer PGA's where both are. Null if
// there is none.
const Conflict* conflict_before_pga(const Map& map, const Body& a, const Body& b);

// By right of way, then by the order in the lane; both where neither says anything.
struct Blame {
    bool a, b;
};
Blame to_blame(const Map& map, const Body& a, const Body& b);

} // namespace intersection_env
