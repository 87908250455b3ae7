// Recorded scenes as the kernels read them, row by row; whole numbers are exact in float below 2^24.
#pragma once

#include <cstdint>

#include "intersection_env/map.hpp"

namespace intersection_env {

constexpr int TRACK_COLUMNS = 12;
// route, half length, half width, top speed, first sample, first step, end step, first recorded step,
// whether it is asked for a stop at its line, first window, and two of nothing
constexpr int SAMPLE_COLUMNS = 5; // position, speed, memory, place, place once braked
// memory, a whole number: twice the steps since it stopped at its line, and 1 more where it is held; place: a whole
// number, x in its lower half and y in its upper one, in steps from a corner (see Grid)
constexpr int COMPANION_COLUMNS = 16;
// end of a lane that they share, where the other has to be in it, offset, may lead; own end, other's end, kind of
// conflict (0 none, 1 crossing, 2 merging, 3 by arrival; negative where the other one yields), went first; fault, the
// conflict's line, half length, half width; other's first sample, first step, end step, rank and route. Two routes that
// conflict twice, or share two lanes, have two rows.
// Their rank and route are one number: rank * MOST_ROUTES_OF_A_MAP + route.
constexpr float BY_ARRIVAL = 3.0F;
constexpr int WINDOW_STEPS = 8;
// of a track, from its first step on; where in the list those of its companions begin that can matter in it; they end
// where the next window's begin

// What the recorded vehicle of a sample saw, a whole number: what it decides had it decided to wait before, and had it
// decided to go, one bit each; above them which companion leads it, counted from 1, or 0.
constexpr std::int32_t GOES_FROM_WAITING = 1, GOES_FROM_GOING = 2, LEADS = 4;

// When a collision with a companion is the acting vehicle's fault.
enum class Fault : std::uint8_t { never, always, before_own_end, past_other_end, looked_up };

// Places in 16 bits a coordinate: enough to tell who is too far away to be touched.
struct Grid {
    float x, y, step; // its corner and the distance of its lines [m]
};

struct RecordedRows {
    const float *tracks, *samples, *companions;
    const float* v_max; // of each sample, or null where no gap decision asks for it
    const std::int32_t *seen, *actors, *windows, *listed;
    int actor_count;
    Grid grid;
};

} // namespace intersection_env
