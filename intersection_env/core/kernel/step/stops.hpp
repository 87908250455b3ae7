// Stops at a line, and who goes first at an all-way stop.
#pragma once

#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// Ours: whoever can no longer stop comes before all who wait, and those before whoever a maneuver tells to wait.
constexpr int SETTLED = 3 << 24, UNDER_WAY = 2 << 24, TOLD = 1 << 24;
static_assert(MOST_WAITED < TOLD);

// The memory of the stop at this step, where one has to be made, and whether it still has to. Needs observe_road.
// must_stop: mask; moves: who is there.
inline void remember_stop(Ints must_stop, Ints moves, VehicleLanes& vehicle) {
    const Ints stops = must_stop & (vehicle.speed < STOPPED) & (vehicle.distance_to_stop_line < AT_LINE);
    vehicle.waited = moves & ((vehicle.waited > 0) | stops) ? vehicle.waited + 1 : vehicle.waited;
    vehicle.refused |= must_stop & (vehicle.waited == 0) & (vehicle.distance_to_stop_line >= 0.0F);
}

// How early a vehicle goes at an all-way stop; the higher one goes first. told: by a maneuver, mask.
inline Ints turn(Ints waited, Ints told, Ints settled, Ints cannot_stop) {
    const Ints waiting = told ? waited - TOLD : waited;
    return settled ? all_ints(SETTLED) : (cannot_stop ? all_ints(UNDER_WAY) : waiting);
}

// +1 where the one that yields on a tie goes first, else -1: as if it were assigned. hold: of the other one; rank: of
// the route of the one that yields on a tie.
inline Ints by_arrival(Ints turn_of_yielder, Ints turn_of_other, Ints hold, Ints rank) {
    const Ints first = (turn_of_yielder > turn_of_other) | ((turn_of_yielder == turn_of_other) & (hold > rank));
    return first ? all_ints(1) : all_ints(-1);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
