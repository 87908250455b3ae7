// What each vehicle sees: its stop line, its road, its lead vehicle; what a yielder sees of a foe.
#pragma once

#include "kernel/lanes/rows.hpp"
#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// One vehicle's route and size; in a prediction the same in every lane, in worlds each lane has its own.
struct UniformVehicle {
    float half_length, max_speed, stop_line, first_conflict, last_row;
    int first_row;

    Ints first() const { return all_ints(first_row); }
    Floats last() const { return all(last_row); }
    Floats top_speed() const { return all(max_speed); }
};

inline Floats braking_distance(Floats speed) {
    const Floats forward = most(speed, all(0.0F));
    return forward * forward * (0.5F / BRAKING);
}

// Where the vehicle is before its line or past it, which is all that decisions need.
template <class Known>
inline void observe_line(const Known& known, VehicleLanes& vehicle) {
    vehicle.front = vehicle.position + known.half_length;
    vehicle.rear = vehicle.position - known.half_length;
    vehicle.distance_to_stop_line = known.stop_line - vehicle.front;
    vehicle.braking_distance = braking_distance(vehicle.speed);
    vehicle.goes_on = (vehicle.speed >= DRIVES) | (vehicle.front > known.first_conflict);
}

// headings: whether the relative headings are wanted too. rows: OBSERVED_COLUMNS a grid point.
template <class Known>
inline void observe_road(const float* rows, float inverse_spacing, const Known& known, bool headings,
                         VehicleLanes& vehicle) {
    observe_line(known, vehicle);
    const Floats grid = vehicle.position * inverse_spacing;
    if (headings) {
        interpolate<2, 2>(rows, known.first(), known.last(), grid, vehicle.environment);
    } else {
        interpolate<1, 2>(rows, known.first(), known.last(), grid, vehicle.environment);
    }
    vehicle.environment[0] = least(vehicle.environment[0], known.top_speed());
    vehicle.environment[1] = least(vehicle.environment[1], known.top_speed());
}

inline void forget_lead(Seen& vehicle) {
    vehicle.lead_distance = all(LEAD_RANGE);
    vehicle.lead_speed = all(FREE_LEAD_SPEED);
    vehicle.queue = all_ints(-1);
}

// Where `leads`, the other is ahead in ego's lane by `gap` [m]; the nearest counts.
// held: the other's remembered hold where both queue in the same stop lane, else -1.
inline void follow(Seen& ego, Ints leads, Floats gap, Floats speed, Ints held) {
    leads &= gap <= ego.lead_distance;
    ego.lead_distance = leads ? gap : ego.lead_distance;
    ego.lead_speed = leads ? speed : ego.lead_speed;
    ego.queue = leads ? held : ego.queue;
}

// The driving network's features; paper, Table I.
inline void driving_features(const VehicleLanes& vehicle, Floats* features) {
    features[0] = vehicle.distance_to_stop_line;
    features[1] = vehicle.speed;
    for (int k = 0; k < 7; ++k) {
        features[2 + k] = vehicle.environment[1 + k];
    }
    features[9] = vehicle.lead_distance;
    features[10] = vehicle.lead_speed;
    features[11] = vehicle.delta ? all(1.0F) : all(0.0F);
}

// What a yielding vehicle and its foe are to each other.
struct Encounter {
    Floats distance_to_pga, speed, v_max, distance_to_stop_line;
    Floats foe_distance_to_line, foe_speed, foe_v_max, foe_distance_to_clear;
    Ints merging; // mask
};

// foe_line: to where it is measured how far the foe still has to go, mostly its stop line.
inline Encounter encounter(const VehicleLanes& yielder, Floats pga, const VehicleLanes& foe, Floats foe_line,
                           Floats foe_end, Ints merging) {
    return {pga - yielder.rear,
            yielder.speed,
            yielder.v_max(),
            yielder.distance_to_stop_line,
            foe_line - foe.front,
            foe.speed,
            foe.v_max(),
            foe_end - foe.rear,
            merging};
}

// The gap network's features; paper, Table I.
inline void gap_features(const Encounter& e, Floats* features) {
    features[0] = e.distance_to_pga;
    features[1] = e.speed;
    features[2] = e.foe_distance_to_line;
    features[3] = e.foe_speed;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
