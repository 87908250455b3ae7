// The smallest distance between any two vehicles that can touch.
#pragma once

#include "kernel/lanes/rows.hpp"
#include "kernel/step/vehicle.hpp"
#include "model/circles.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

inline Circles<Floats> circles(const Problem& problem, const ProblemVehicle& known, const VehicleLanes& vehicle) {
    Floats pose[4];
    interpolate<1, 1>(problem.pose, all_ints(known.first_row), all(static_cast<float>(known.last_row)),
                      vehicle.position * problem.inverse_spacing, pose);
    Floats cosine, sine;
    direction(pose[2], cosine, sine);
    const float offset = CIRCLE_OFFSET * 2.0F * known.half_length;
    return {pose[0], pose[1], offset * cosine, offset * sine};
}

inline Ints meets(const VehicleLanes& vehicle, const Interval& interval) {
    return (vehicle.front >= interval.begin) & (vehicle.rear <= interval.end);
}

// Per lane: the distance between the borders of two vehicles that touch says can touch; NO_DISTANCE elsewhere.
inline Floats distance(const Touch& touch, Ints present, const VehicleLanes& a, const VehicleLanes& b,
                       const Circles<Floats>* bodies) {
    const Ints near = present & meets(a, touch.on_a) & meets(b, touch.on_b);
    if (!any(near)) {
        return all(NO_DISTANCE);
    }
    return near ? root(squared_distance(bodies[touch.a], bodies[touch.b])) - touch.radii : all(NO_DISTANCE);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
