#include "model/contact.hpp"

#include <algorithm>
#include <cmath>

#include "model/circles.hpp"
#include "model/rectangle.hpp"

namespace intersection_env {
namespace {

Circles<float> circles(const Map& map, const Body& body) {
    const Sample sample = straight_on(map, body.route, body.position);
    const float offset = CIRCLE_OFFSET * body.length;
    return {sample.x, sample.y, offset * std::cos(sample.heading), offset * std::sin(sample.heading)};
}

Rectangle<float> rectangle(const Map& map, const Body& body) {
    const Sample sample = straight_on(map, body.route, body.position);
    return {sample.x,           sample.y,         std::cos(sample.heading), std::sin(sample.heading),
            0.5F * body.length, 0.5F * body.width};
}

bool meets(const Body& body, const Interval& interval) {
    return body.front() >= interval.begin && body.rear() <= interval.end;
}

bool can_touch(const Map& map, const Body& a, const Body& b) {
    if (a.route == b.route) {
        return true;
    }
    const Overlap* overlap = map.overlap(a.route, b.route);
    if (overlap == nullptr) {
        return false;
    }
    const bool in_order = overlap->a == a.route;
    return meets(a, in_order ? overlap->on_a : overlap->on_b) && meets(b, in_order ? overlap->on_b : overlap->on_a);
}

// Between the borders of their circles [m]; NO_DISTANCE where they cannot touch.
float between_circles(const Map& map, const Body& a, const Body& b) {
    if (!can_touch(map, a, b)) {
        return NO_DISTANCE;
    }
    return std::sqrt(squared_distance(circles(map, a), circles(map, b))) - CIRCLE_RADIUS * (a.width + b.width);
}

// How far b is ahead of a in a lane they share [m]; 0 where they share none here.
float ahead(const Map& map, const Body& a, const Body& b) {
    if (a.route == b.route) {
        return b.position - a.position;
    }
    const SharedLane* shared = map.shared_lane(a.route, b.route);
    if (shared == nullptr) {
        return 0.0F;
    }
    if (a.rear() < shared->split && b.rear() < shared->split) {
        return b.position - a.position;
    }
    const bool in_order = shared->a == a.route;
    const float offset = in_order ? shared->offset : -shared->offset, between = b.position - offset - a.position;
    const float merge_a = in_order ? shared->merge_a : shared->merge_b;
    const float merge_b = in_order ? shared->merge_b : shared->merge_a;
    return (between > 0.0F ? b.front() > merge_b : a.front() > merge_a) ? between : 0.0F;
}

} // namespace

Sample straight_on(const Map& map, int route, float position) {
    Sample sample = map.at(route, position);
    const std::size_t rows = map.routes[static_cast<std::size_t>(route)].samples.size();
    const float beyond = std::max(position - map.spacing * static_cast<float>(rows - 1), 0.0F);
    sample.x += beyond * std::cos(sample.heading);
    sample.y += beyond * std::sin(sample.heading);
    return sample;
}

float clearance(const Map& map, const Body& a, const Body& b) {
    return can_touch(map, a, b) ? std::sqrt(squared_distance(rectangle(map, a), rectangle(map, b))) : NO_DISTANCE;
}

bool collide(const Map& map, const Body& a, const Body& b, float braking_a, float braking_b) {
    if (between_circles(map, a, b) < COLLISION_DISTANCE) {
        return true;
    }
    Body braked_a = a, braked_b = b;
    braked_a.position += braking_a;
    braked_b.position += braking_b;
    return between_circles(map, braked_a, braked_b) < COLLISION_DISTANCE;
}

Blame to_blame(const Map& map, const Body& a, const Body& b) {
    if (const Conflict* conflict = map.conflict(a.route, b.route)) {
        const bool a_yields = conflict->yielder == a.route;
        if ((a_yields ? a : b).rear() < conflict->on_yielder.end) {
            return {a_yields, !a_yields};
        }
    }
    const float between = ahead(map, a, b);
    return {between >= 0.0F, between <= 0.0F};
}

} // namespace intersection_env
