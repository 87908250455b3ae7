// Who enters: assigned priorities first, then the rule or the gap network; and who is held.
#pragma once

#include "kernel/block.hpp"
#include "kernel/network.hpp"
#include "kernel/observe.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float CRITICAL_GAP_CROSSING = 6.0F, CRITICAL_GAP_MERGING = 4.0F; // [s], paper, Section II-B
constexpr float LEAST_FOE_SPEED = 1.0F; // [m/s], ours: a standing foe may start at any moment
constexpr float SUMO_TIME_GAP = 1.0F;   // [s], SUMO's jmTimegapMinor

// Mask: the yielder accepts the gap to the prioritized vehicle.
inline Ints accepts_gap(const Problem& problem, const ProblemPair& pair, const VehicleLanes& yielder,
                        const VehicleLanes& foe) {
    if (problem.gap == Gap::critical_gap) {
        const float critical = pair.merging ? CRITICAL_GAP_MERGING : CRITICAL_GAP_CROSSING;
        return foe.distance_to_stop_line > critical * most(foe.speed, all(LEAST_FOE_SPEED));
    }
    if (problem.gap == Gap::sumo) {
        const Floats leaves = (pair.yielder_end - yielder.rear) / yielder.v_max();
        const Floats foe_arrives = foe.distance_to_stop_line / foe.v_max();
        const Floats foe_leaves = (pair.prioritized_end - foe.rear) / foe.v_max();
        return (foe_arrives > leaves + SUMO_TIME_GAP) | (foe_leaves < yielder.distance_to_stop_line / yielder.v_max());
    }
    Floats input[GAP_INPUTS];
    gap_features(pair, yielder, foe, input);
    return evaluate<GAP_INPUTS>(*problem.gap_network, input, LeakyRelu{}) > 0.0F;
}

inline void decide_pair(const Problem& problem, const ProblemPair& pair, Ints assignment, Block& block) {
    VehicleLanes &i = block.vehicles[pair.yielder], &j = block.vehicles[pair.prioritized];
    const Ints swapped = assignment > 0;
    const Ints second_is_yielder = (i.rear < pair.yielder_end) & (j.position < pair.prioritized_end);
    const Ints second_is_prioritized = (j.rear < pair.prioritized_end) & (i.position < pair.yielder_end);
    const Ints active = i.present & j.present & (swapped ? second_is_prioritized : second_is_yielder);
    const Ints assigned_to_i = active & (assignment < 0), assigned_to_j = active & swapped;
    const Ints open = active & (assignment == 0) & (j.hold <= problem.vehicles[pair.yielder].route);
    Ints refused = assigned_to_i;
    if (any(open)) {
        refused |= open & ~accepts_gap(problem, pair, i, j);
    }
    i.refused |= refused;
    i.refused_by_assignment |= assigned_to_i;
    j.refused |= assigned_to_j;
    j.refused_by_assignment |= assigned_to_j;
}

// After all pairs: the decision that holds, and whom it holds up.
inline void decide_vehicle(const Problem& problem, int index, VehicleLanes& vehicle) {
    const Ints cannot_stop = vehicle.distance_to_stop_line < vehicle.braking_distance;
    vehicle.delta = ~vehicle.refused | (vehicle.delta & cannot_stop);
    const Ints waits =
        vehicle.refused_by_assignment ? all_ints(problem.route_count) : all_ints(problem.vehicles[index].route);
    vehicle.hold = most(vehicle.delta ? all_ints(-1) : waits, vehicle.queue);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
