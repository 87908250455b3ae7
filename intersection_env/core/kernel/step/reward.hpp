// What a vehicle is paid for one step; paper, Table II.
#pragma once

#include "kernel/step/observe.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float BASE_REWARD = 2.0F, COLLISION_PENALTY = 5000.0F;
constexpr float COMFORTABLE_BRAKING = 1.0F; // [m/s²], paper, Eq. (4)

// How far the vehicle may still drive [m], at least 0: to its lead, and to its stop line while it waits.
inline Floats free_distance(const VehicleLanes& vehicle) {
    const Floats waiting = least(vehicle.lead_distance, vehicle.distance_to_stop_line);
    return most(vehicle.delta ? vehicle.lead_distance : waiting, all(0.0F));
}

// The least speed that is not too slow; paper, Eq. (4).
inline Floats least_speed(const VehicleLanes& vehicle) {
    return least(vehicle.v_max(), root(2.0F * COMFORTABLE_BRAKING * free_distance(vehicle)));
}

// The penalties for where the vehicle is and how fast, but for a speed too low: rows 5 to 8.
inline Floats trespass(const VehicleLanes& vehicle) {
    const Floats none = all(0.0F), speed = vehicle.speed;
    const Floats overshoot = most(vehicle.braking_distance - vehicle.distance_to_stop_line, none);
    return 30.0F / vehicle.v_max() * most(speed - vehicle.v_max(), none) + 30.0F * most(-speed, none) +
           30.0F * most(vehicle.braking_distance - vehicle.lead_distance, none) +
           (vehicle.delta ? none : 30.0F * overshoot);
}

// Row 4.
inline Floats slowness(const VehicleLanes& vehicle) {
    return 20.0F / vehicle.v_max() * most(least_speed(vehicle) - vehicle.speed, all(0.0F));
}

inline Floats reward(const VehicleLanes& vehicle, Floats acceleration, Ints blamed) {
    const Floats size = magnitude(acceleration), none = all(0.0F);
    const Floats effort = 0.01F * size * size + (size > 2.5F ? all(1.0F) : none) + (size > 4.0F ? all(20.0F) : none);
    return BASE_REWARD - effort - slowness(vehicle) - trespass(vehicle) - (blamed ? all(COLLISION_PENALTY) : none);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
