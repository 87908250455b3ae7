// The smallest distance between any two vehicles that can touch.
#pragma once

#include "circles.hpp"
#include "kernel/block.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// cos and sin by polynomials after reduction to [-pi/4, pi/4]; absolute error under 1e-6 for |x| < 100.
inline void direction(Floats angle, Floats& cosine, Floats& sine) {
    const Floats turns = angle * 0.636619772F;
    const Ints quarter = __builtin_convertvector(turns + (turns < 0.0F ? all(-0.5F) : all(0.5F)), Ints);
    const Floats n = __builtin_convertvector(quarter, Floats);
    const Floats x = (angle - n * 1.57079637F) + n * 4.37113883e-08F;
    const Floats q = x * x;
    const Floats s = x * (1.0F + q * (-0.166666667F + q * (0.00833333333F + q * -0.000198412698F)));
    const Floats c = 1.0F + q * (-0.5F + q * (0.0416666667F + q * (-0.00138888889F + q * 2.48015873e-05F)));
    const Ints odd = (quarter & 1) != 0;
    const Floats a = odd ? s : c, b = odd ? c : s;
    cosine = ((quarter + 1) & 2) != 0 ? -a : a;
    sine = (quarter & 2) != 0 ? -b : b;
}

inline Circles<Floats> circles(const Problem& problem, const ProblemVehicle& known, const VehicleLanes& vehicle) {
    Floats pose[3];
    interpolate<3, POSE_COLUMNS>(known.pose, known.last_sample, vehicle.position * problem.inverse_spacing, pose);
    Floats cosine, sine;
    direction(pose[2], cosine, sine);
    const float offset = CIRCLE_OFFSET * 2.0F * known.half_length;
    return {pose[0], pose[1], offset * cosine, offset * sine};
}

inline Ints meets(const VehicleLanes& vehicle, const Interval& interval) {
    return (vehicle.front >= interval.begin) & (vehicle.rear <= interval.end);
}

// Per lane: the smallest distance between borders now, or NO_DISTANCE where no two can touch.
inline Floats smallest_distance(const Problem& problem, Block& block, Floats so_far) {
    Circles<Floats> bodies[MAX_VEHICLES];
    const int count = problem.vehicle_count;
    for (int i = 0; i < count; ++i) {
        bodies[i] = circles(problem, problem.vehicles[i], block.vehicles[i]);
    }
    for (int t = 0; t < problem.touch_count; ++t) {
        const Touch& touch = problem.touches[t];
        const VehicleLanes &a = block.vehicles[touch.a], &b = block.vehicles[touch.b];
        const Ints near = a.present & b.present & meets(a, touch.on_a) & meets(b, touch.on_b);
        if (!any(near)) {
            continue;
        }
        const Floats squared = squared_distance(bodies[touch.a], bodies[touch.b]);
        Floats distance;
        for (int l = 0; l < WIDTH; ++l) {
            distance[l] = __builtin_sqrtf(squared[l]);
        }
        distance -= touch.radii;
        so_far = near ? least(so_far, distance) : so_far;
    }
    return so_far;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
