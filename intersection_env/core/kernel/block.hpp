// The state of one block of scenarios while it runs.
#pragma once

#include "kernel/lanes.hpp"
#include "problem.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// What one vehicle is and sees at one moment, in every lane.
struct VehicleLanes {
    Floats position, speed, time_loss;
    Ints present, delta, hold; // the memories of the model; delta is a mask

    Floats front, rear, distance_to_stop_line, braking_distance;
    Floats environment[7]; // v_max, six relative headings
    Floats lead_distance, lead_speed;
    Ints queue; // the remembered hold of the lead in the same stop lane, else -1

    Ints refused, refused_by_assignment; // masks, from the pairs

    Floats v_max() const { return environment[0]; }
};

struct Block {
    VehicleLanes vehicles[MAX_VEHICLES];
    Ints assignments[MAX_PAIRS];
};

} // namespace intersection_env::INTERSECTION_ENV_ISA
