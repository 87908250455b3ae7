#include "model/contact.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

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
    return std::ranges::any_of(map.overlaps_of(a.route, b.route), [&](const Overlap& row) {
        const Overlap overlap = row.seen_from(a.route);
        return meets(a, overlap.on_a) && meets(b, overlap.on_b);
    });
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
    for (const SharedLane& row : map.shared_lanes_of(a.route, b.route)) {
        const SharedLane lane = row.seen_from(a.route);
        const float there = b.position - lane.offset, between = there - a.position;
        const bool before_end = a.rear() < lane.end && there - 0.5F * b.length < lane.end;
        if (before_end && (between > 0.0F ? b.front() > lane.begin_b : a.front() > lane.begin_a)) {
            return between;
        }
    }
    return 0.0F;
}

} // namespace

Bodies bodies_named(std::string_view name) {
    if (name == "circles") {
        return Bodies::circles;
    }
    if (name == "rectangles") {
        return Bodies::rectangles;
    }
    throw std::invalid_argument("bodies is \"" + std::string(name) + "\"; wanted circles or rectangles");
}

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

bool collide(const Map& map, const Body& a, const Body& b, float braking_a, float braking_b, Bodies bodies) {
    const auto between = bodies == Bodies::rectangles ? clearance : between_circles;
    if (between(map, a, b) < COLLISION_DISTANCE) {
        return true;
    }
    Body braked_a = a, braked_b = b;
    braked_a.position += braking_a;
    braked_b.position += braking_b;
    return between(map, braked_a, braked_b) < COLLISION_DISTANCE;
}

const Conflict* conflict_before_pga(const Map& map, const Body& a, const Body& b) {
    const Conflict* nearest = nullptr;
    float least = 0.0F;
    for (const auto& [own, other] : {std::pair(&a, &b), std::pair(&b, &a)}) {
        const Conflict* conflict = map.conflict(own->route, other->route);
        const float to_pga = conflict == nullptr ? 0.0F : conflict->on_yielder.end - own->rear();
        if (to_pga > 0.0F && (nearest == nullptr || to_pga < least)) {
            nearest = conflict;
            least = to_pga;
        }
    }
    return nearest;
}

Blame to_blame(const Map& map, const Body& a, const Body& b) {
    if (const Conflict* conflict = conflict_before_pga(map, a, b)) {
        const bool a_yields = conflict->yielder == a.route;
        const bool a_later = conflict->by_arrival && a.waited != b.waited ? a.waited < b.waited : a_yields;
        return {a_later, !a_later};
    }
    const float between = ahead(map, a, b);
    return {between >= 0.0F, between <= 0.0F};
}

} // namespace intersection_env
