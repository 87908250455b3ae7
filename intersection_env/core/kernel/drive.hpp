// The acceleration: Intelligent Driver Model, driving network, or none; and what it does to the state.
#pragma once

#include "kernel/block.hpp"
#include "kernel/network.hpp"
#include "kernel/observe.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float LEAST_GAP = 0.1F; // [m], ours: keeps the model finite where bumpers touch

// inverse_root: 1 / (2 sqrt(a b))
inline Floats idm(const IdmParameters& p, float inverse_root, Floats speed, Floats v_max, Floats gap,
                  Floats lead_speed) {
    const Floats ratio = speed / v_max;
    const Floats dynamic = speed * p.time_gap + speed * (speed - lead_speed) * inverse_root;
    const Floats wanted = (p.standing_gap + most(dynamic, all(0.0F))) / most(gap, all(LEAST_GAP));
    return p.acceleration * (1.0F - ratio * ratio * ratio * ratio - wanted * wanted);
}

inline Floats drive(const Problem& problem, float inverse_root, const VehicleLanes& vehicle) {
    if (problem.driver == Driver::constant_velocity) {
        return all(0.0F);
    }
    if (problem.driver == Driver::idm) {
        const IdmParameters& p = problem.idm;
        const Floats follow =
            idm(p, inverse_root, vehicle.speed, vehicle.v_max(), vehicle.lead_distance, vehicle.lead_speed);
        const Floats stop =
            idm(p, inverse_root, vehicle.speed, vehicle.v_max(), vehicle.distance_to_stop_line, all(0.0F));
        const Floats chosen = vehicle.delta ? follow : least(follow, stop);
        return least(most(chosen, all(-p.deceleration_limit)), all(p.acceleration));
    }
    Floats input[DRIVING_INPUTS];
    driving_features(vehicle, input);
    return problem.acceleration_scale * tanh(evaluate<DRIVING_INPUTS>(*problem.driving_network, input, Tanh{}));
}

// Moves the vehicle by one step, no slower than `least_speed`, where `moves`; returns the acceleration that came of it.
inline Floats advance(Floats acceleration, float least_speed, Ints moves, VehicleLanes& vehicle) {
    const Floats speed = most(vehicle.speed + DT * acceleration, all(least_speed));
    const Floats position = vehicle.position + (0.5F * DT) * (vehicle.speed + speed);
    const Floats applied = moves ? (speed - vehicle.speed) * (1.0F / DT) : all(0.0F);
    vehicle.position = moves ? position : vehicle.position;
    vehicle.speed = moves ? speed : vehicle.speed;
    return applied;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
