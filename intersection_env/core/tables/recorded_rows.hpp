// Recorded scenes as the kernels read them, row by row; whole numbers are exact in float below 2^24.
#pragma once

#include <cstdint>

namespace intersection_env {

constexpr int TRACK_COLUMNS = 12;
// route, half length, half width, top speed, first sample, first step, end step, first recorded step,
// first companion, companion count, whether it is asked for a stop at its line, first window
constexpr int SAMPLE_COLUMNS = 8; // position, speed, memory, v_max, x, y, x and y once braked
// memory: twice the steps since it stopped at its line, and 1 more where it is held
constexpr int COMPANION_COLUMNS = 16;
// end of a lane that they share, where the other has to be in it, offset, may lead; own end, other's end, kind of
// conflict (0 none, 1 crossing, 2 merging, 3 by arrival; negative where the other one yields), went first; fault, the
// conflict's line, half length, half width; other's first sample, first step, end step, route. Two routes that conflict
// twice, or share two lanes, have two rows.
constexpr float BY_ARRIVAL = 3.0F;
constexpr int SEEN_COLUMNS = 4;
// what the recorded vehicle of a sample sees and says: distance and speed of its lead, whether it is refused (1) had it
// decided to wait before, and had it decided to go
constexpr int WINDOW_STEPS = 8;
// of a track, from its first step on; of each, where in the list those of its companions begin that are present in it,
// and where they end

// When a collision with a companion is the acting vehicle's fault.
enum class Fault : std::uint8_t { never, always, before_own_end, past_other_end, looked_up };

struct RecordedRows {
    const float *tracks, *samples, *companions, *acceleration, *seen;
    const std::int32_t *actors, *windows, *listed;
    int actor_count;
};

} // namespace intersection_env
