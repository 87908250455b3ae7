// What each vehicle sees: its stop line, its road, its lead vehicle.
#pragma once

#include "kernel/block.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// headings: whether the relative headings are wanted too.
inline void observe_road(const Problem& problem, const ProblemVehicle& known, bool headings, VehicleLanes& vehicle) {
    vehicle.front = vehicle.position + known.half_length;
    vehicle.rear = vehicle.position - known.half_length;
    vehicle.distance_to_stop_line = known.stop_line - vehicle.front;
    const Floats forward = most(vehicle.speed, all(0.0F));
    vehicle.braking_distance = forward * forward * (0.5F / BRAKING);
    const Floats grid = vehicle.position * problem.inverse_spacing;
    if (headings) {
        interpolate<7, OBSERVED_COLUMNS>(known.observed, known.last_sample, grid, vehicle.environment);
    } else {
        interpolate<1, OBSERVED_COLUMNS>(known.observed, known.last_sample, grid, vehicle.environment);
    }
    vehicle.environment[0] = least(vehicle.environment[0], all(known.max_speed));
}

// Needs observe_road of every vehicle first.
inline void observe_lead(const Problem& problem, Block& block, int i) {
    VehicleLanes& ego = block.vehicles[i];
    ego.lead_distance = all(LEAD_RANGE);
    ego.lead_speed = all(FREE_LEAD_SPEED);
    ego.queue = all_ints(-1);
    const ProblemVehicle& known = problem.vehicles[i];
    for (int c = known.first_candidate; c < known.last_candidate; ++c) {
        const LeadCandidate& candidate = problem.candidates[c];
        const VehicleLanes& other = block.vehicles[candidate.other];
        const Floats ahead = other.position - candidate.offset - ego.position;
        Ints leads = other.present & (ahead > 0.0F);
        if (candidate.after_merge) {
            leads &= other.front > candidate.merge;
        } else {
            leads &= (ego.rear < candidate.split) & (other.rear < candidate.split);
        }
        const Floats gap = ahead - candidate.half_lengths;
        leads &= gap <= ego.lead_distance;
        ego.lead_distance = leads ? gap : ego.lead_distance;
        ego.lead_speed = leads ? other.speed : ego.lead_speed;
        ego.queue = leads ? (candidate.same_stop_lane ? other.hold : all_ints(-1)) : ego.queue;
    }
    ego.queue = ego.distance_to_stop_line >= 0.0F ? ego.queue : all_ints(-1);
}

// The features of the two networks; paper, Table I.
inline void driving_features(const VehicleLanes& vehicle, Floats* features) {
    features[0] = vehicle.distance_to_stop_line;
    features[1] = vehicle.speed;
    for (int k = 0; k < 7; ++k) {
        features[2 + k] = vehicle.environment[k];
    }
    features[9] = vehicle.lead_distance;
    features[10] = vehicle.lead_speed;
    features[11] = vehicle.delta ? all(1.0F) : all(0.0F);
}

inline void gap_features(const ProblemPair& pair, const VehicleLanes& yielder, const VehicleLanes& foe,
                         Floats* features) {
    features[0] = pair.yielder_end - yielder.rear;
    features[1] = yielder.speed;
    features[2] = foe.distance_to_stop_line;
    features[3] = foe.speed;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
