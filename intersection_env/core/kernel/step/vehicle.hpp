// What one vehicle is and sees at one moment, in every lane.
#pragma once

#include "kernel/lanes/lanes.hpp"
#include "tables/problem.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// What the pairs add up to for one vehicle.
struct Seen {
    Floats lead_distance, lead_speed;
    Ints queue;   // the remembered hold of the lead in the same stop lane, else -1
    Ints refused; // mask
    Ints kept;    // mask: waits for a vehicle under way that yields to it
};

struct VehicleLanes : Seen {
    Floats position, speed;
    Ints delta, hold, waited; // the memories of the model; delta is a mask

    Floats front, rear, distance_to_stop_line, braking_distance;
    Ints goes_on;          // mask: drives, or is in its first conflict; past its line it does not wait there
    Floats environment[8]; // the IDM's free speed, v_max, six relative headings

    Floats free_speed() const { return environment[0]; }
    Floats v_max() const { return environment[1]; }
};

} // namespace intersection_env::INTERSECTION_ENV_ISA
