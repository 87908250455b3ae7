// The smallest distance between any two vehicles that can touch.
#pragma once

#include "kernel/lanes/rows.hpp"
#include "kernel/step/vehicle.hpp"
#include "model/rectangle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

inline Rectangle<Floats> body(const Problem& problem, const ProblemVehicle& known, const VehicleLanes& vehicle) {
    Floats pose[4];
    interpolate<1, 1>(problem.pose, all_ints(known.first_row), all(static_cast<float>(known.last_row)),
                      vehicle.position * problem.inverse_spacing, pose);
    Floats cosine, sine;
    direction(pose[2], cosine, sine);
    return {pose[0], pose[1], cosine, sine, known.half_length, known.half_width};
}

inline Ints meets(const VehicleLanes& vehicle, const Interval& interval) {
    return (vehicle.front >= interval.begin) & (vehicle.rear <= interval.end);
}

// Centres nearer than this can belong to bodies nearer than so_far [m²].
template <class F>
[[gnu::always_inline]] inline F squared_range(const Touch& touch, F so_far) {
    const F range = (so_far < FAR ? so_far : F{} + FAR) + touch.reach;
    return range * range;
}

// Per lane: so_far, or the distance between two bodies that touch says can touch, where that is smaller.
inline Floats nearer(const Touch& touch, Ints present, const VehicleLanes& a, const VehicleLanes& b,
                     const Rectangle<Floats>* bodies, Floats so_far) {
    const Rectangle<Floats>&one = bodies[touch.a], &other = bodies[touch.b];
    const Floats x = one.x - other.x, y = one.y - other.y;
    const Ints near =
        present & (x * x + y * y < squared_range(touch, so_far)) & meets(a, touch.on_a) & meets(b, touch.on_b);
    if (!any(near)) {
        return so_far;
    }
    return near ? least(so_far, root(squared_distance(one, other))) : so_far;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
