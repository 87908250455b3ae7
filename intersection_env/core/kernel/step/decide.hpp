// Who enters: the gap decision of a pair, and the decision of a vehicle that follows from all its pairs.
#pragma once

#include "kernel/lanes/network.hpp"
#include "kernel/step/observe.hpp"
#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float CRITICAL_GAP_CROSSING = 6.0F, CRITICAL_GAP_MERGING = 4.0F; // [s], paper, Section II-B
constexpr float LEAST_FOE_SPEED = 1.0F; // [m/s], ours: a standing foe may start at any moment
constexpr float SUMO_TIME_GAP = 1.0F;   // [s], SUMO's jmTimegapMinor

// The gap network's logit of accepting the gap.
inline Floats gap_logit(const GapNetwork& network, const Encounter& e) {
    Floats input[GAP_INPUTS];
    gap_features(e, input);
    return evaluate(network, input, LeakyRelu{});
}

// Mask: the yielder accepts the gap to the prioritized vehicle. patience: what the network's logit must exceed.
inline Ints accepts_gap(Gap gap, const GapNetwork* network, const Encounter& e, Floats patience = Floats{}) {
    if (gap == Gap::critical_gap) {
        const Floats critical = e.merging ? all(CRITICAL_GAP_MERGING) : all(CRITICAL_GAP_CROSSING);
        return e.foe_distance_to_line > critical * most(e.foe_speed, all(LEAST_FOE_SPEED));
    }
    if (gap == Gap::sumo) {
        const Floats leaves = e.distance_to_pga / e.v_max;
        const Floats foe_arrives = e.foe_distance_to_line / e.foe_v_max;
        const Floats foe_leaves = e.foe_distance_to_clear / e.foe_v_max;
        return (foe_arrives > leaves + SUMO_TIME_GAP) | (foe_leaves < e.distance_to_stop_line / e.v_max);
    }
    return gap_logit(*network, e) > patience;
}

// Mask: past stopping at its line, and does not wait beyond it. Needs observe_road.
inline Ints under_way(const VehicleLanes& vehicle) {
    return (vehicle.distance_to_stop_line < vehicle.braking_distance) & vehicle.goes_on;
}

// Mask: the vehicle has decided to enter and is under way, whatever its pairs say.
inline Ints settled(const VehicleLanes& vehicle) { return vehicle.delta & under_way(vehicle); }

// Mask: the second of an assigned pair has its front in the conflict while the pair is active.
inline Ints disobeys(Ints active, Ints assignment, Floats beyond_entry, Floats foe_beyond_entry) {
    return active & (assignment != 0) & ((assignment > 0 ? foe_beyond_entry : beyond_entry) > 0.0F);
}

// After all pairs: the decision that holds, and whom it holds up. waits: the hold of a vehicle that is refused.
inline void decide_vehicle(VehicleLanes& vehicle, Ints waits) {
    vehicle.delta = ~(vehicle.refused | vehicle.kept) | settled(vehicle);
    const Ints in_queue = (vehicle.distance_to_stop_line >= 0.0F) | ~vehicle.goes_on;
    const Ints queue = in_queue ? vehicle.queue : all_ints(-1);
    vehicle.hold = most(vehicle.refused & ~vehicle.delta ? waits : all_ints(-1), queue);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
