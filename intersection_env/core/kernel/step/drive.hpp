// The acceleration: Intelligent Driver Model, driving network, or none; and what it does to the state.
#pragma once

#include "kernel/lanes/network.hpp"
#include "kernel/step/observe.hpp"
#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float LEAST_GAP = 0.1F; // [m], ours: keeps the model finite where bumpers touch

// Ours, of what limits a network:
constexpr float LEAST_LEAD_GAP = 1.0F; // [m], ours: SUMO's least; where lanes fan out, bodies are nearer than bumpers
constexpr float BEFORE_LINE = 0.4F;    // [m], ours: where the simulated drivers stand, clear of who passes

// 1 / (2 sqrt(a b)) of the model.
inline float inverse_root_of(const IdmParameters& p) { return 0.5F / __builtin_sqrtf(p.acceleration * p.deceleration); }

// inverse_root: inverse_root_of(p). What the road alone asks for takes the speed to the free speed in a step at most:
// where that is low, the fourth power would throw it to and fro.
inline Floats idm(const IdmParameters& p, float inverse_root, Floats speed, Floats free_speed, Floats gap,
                  Floats lead_speed) {
    const Floats ratio = speed / free_speed;
    const Floats dynamic = speed * fused(speed - lead_speed, all(inverse_root), all(p.time_gap));
    const Floats wanted = (p.standing_gap + most(dynamic, all(0.0F))) / most(gap, all(LEAST_GAP));
    const Floats none = all(0.0F), reach = (free_speed - speed) * (1.0F / (DT * p.acceleration));
    const Floats road = 1.0F - ratio * ratio * ratio * ratio;
    return p.acceleration * (least(most(road, least(reach, none)), most(reach, none)) - wanted * wanted);
}

// Whoever goes on with a speed for a step and then brakes by b stands after DT / 2 (speed + next) + next² / 2b.
// The part of that way which belongs to the next speed:
inline Floats way_after(Floats next, float b) { return next * fused(next, all(0.5F / b), all(0.5F * DT)); }

// The next speed to which such a part belongs; below 0 where there is none.
inline Floats speed_before(Floats way, float b) {
    return b * (root(most(fused(way, all(2.0F / b), all(0.25F * DT * DT)), all(0.0F))) - 0.5F * DT);
}

// What keeps a network to the rules: whoever must not cross the line stays able to stop there, or stops at once where
// it is not, and everybody can stop behind the lead, whatever that one does. hardest: the strongest braking of all
// vehicles [m/s²].
inline Floats limited(const VehicleLanes& vehicle, Floats acceleration, float hardest) {
    const Floats lead_next = most(vehicle.lead_speed - DT * hardest, all(0.0F));
    const Floats to_lead = fused(vehicle.lead_speed, all(0.5F * DT), vehicle.lead_distance - LEAST_LEAD_GAP) +
                           way_after(lead_next, hardest);
    const Floats behind_lead = fused(vehicle.speed, all(-0.5F * DT), to_lead);
    const Floats before_line = fused(vehicle.speed, all(-0.5F * DT), vehicle.distance_to_stop_line - BEFORE_LINE);
    const Floats next = most(fused(acceleration, all(DT), vehicle.speed), all(0.0F));
    const Ints close = way_after(next, hardest) > behind_lead;
    const Ints held = ~vehicle.delta & (way_after(next, BRAKING) > before_line);
    if (!any(close | held)) {
        return acceleration;
    }
    const Floats follows = (speed_before(behind_lead, hardest) - vehicle.speed) * (1.0F / DT);
    const Floats stops = (speed_before(before_line, BRAKING) - vehicle.speed) * (1.0F / DT);
    const Floats slower = least(close ? follows : acceleration, held ? stops : acceleration);
    return most(slower, all(-hardest));
}

// top_speed: the vehicle's own, beyond which a network does not accelerate [m/s].
inline Floats drive(const Problem& problem, float inverse_root, Floats top_speed, const VehicleLanes& vehicle) {
    if (problem.driver == Driver::constant_velocity) {
        return all(0.0F);
    }
    if (problem.driver == Driver::idm) {
        const IdmParameters& p = problem.idm;
        const Floats follow =
            idm(p, inverse_root, vehicle.speed, vehicle.free_speed(), vehicle.lead_distance, vehicle.lead_speed);
        const Floats stop =
            idm(p, inverse_root, vehicle.speed, vehicle.free_speed(), vehicle.distance_to_stop_line, all(0.0F));
        const Floats chosen = vehicle.delta ? follow : least(follow, stop);
        return least(most(chosen, all(-p.deceleration_limit)), all(p.acceleration));
    }
    Floats input[DRIVING_INPUTS];
    driving_features(vehicle, input);
    const float scale = problem.acceleration_scale;
    const Floats wanted = scale * tanh(evaluate(*problem.driving_network, input, Tanh{}));
    const Floats to_top = (most(vehicle.speed, top_speed) - vehicle.speed) * (1.0F / DT);
    return limited(vehicle, least(wanted, to_top), scale);
}

// Moves the vehicle by one step, no slower than `least_speed`, where `moves`; returns the acceleration that came of it.
inline Floats advance(Floats acceleration, float least_speed, Ints moves, VehicleLanes& vehicle) {
    const Floats speed = most(fused(acceleration, all(DT), vehicle.speed), all(least_speed));
    const Floats position = fused(vehicle.speed + speed, all(0.5F * DT), vehicle.position);
    const Floats applied = moves ? (speed - vehicle.speed) * (1.0F / DT) : all(0.0F);
    vehicle.position = moves ? position : vehicle.position;
    vehicle.speed = moves ? speed : vehicle.speed;
    return applied;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
