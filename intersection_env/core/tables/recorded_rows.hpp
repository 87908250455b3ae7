// Recorded scenes as the kernels read them, row by row; whole numbers are exact in float below 2^24.
#pragma once

#include <cstdint>

namespace intersection_env {

constexpr int TRACK_COLUMNS = 12;
// route, half length, half width, top speed, first sample, first step, end step, first recorded step,
// first companion, companion count, 0, 0
constexpr int SAMPLE_COLUMNS = 8; // position, speed, held (mask as -1 or 0), v_max, x, y, x and y once braked
constexpr int COMPANION_COLUMNS = 16;
// split, other's merge, offset, may lead; own end, other's end, kind of conflict in which the own one yields (0 none,
// 1 crossing, 2 merging), went first; fault, other's stop line, half length, half width; other's first sample, first
// step, end step, route

// When a collision with a companion is the acting vehicle's fault.
enum class Fault : std::uint8_t { never, always, before_own_end, past_other_end };

struct RecordedRows {
    const float *tracks, *samples, *companions, *acceleration;
    const std::int32_t* actors;
    int actor_count;
};

} // namespace intersection_env
