#include "worlds/recorded_order.hpp"

#include <algorithm>

#include "tables/problem.hpp"

namespace intersection_env {
namespace {

constexpr float NEVER = 1.0e9F; // [steps], later than any scene ends

std::size_t at(long index) { return static_cast<std::size_t>(index); }

// When the track's centre reaches an arc length, in steps of its scene; NEVER if it does not.
float reaches(const RecordedScenes& scenes, int track, float arc_length) {
    const long begin = scenes.first_sample(track);
    for (long k = begin; k < scenes.end_sample(track); ++k) {
        if (scenes.position[at(k)] >= arc_length) {
            const float step = static_cast<float>(scenes.first_step(track) + (k - begin));
            if (k == begin) {
                return step;
            }
            const float before = scenes.position[at(k - 1)];
            return step - (scenes.position[at(k)] - arc_length) / (scenes.position[at(k)] - before);
        }
    }
    return NEVER;
}

} // namespace

bool is_ahead(const RecordedScenes& scenes, const SharedLane& lane, int own, int other) {
    const int step = std::max(scenes.first_step(own), scenes.first_step(other));
    const auto position = [&](int track) {
        return scenes.position[at(scenes.first_sample(track) + step - scenes.first_step(track))];
    };
    if (lane.begin_a > -FAR || lane.begin_b > -FAR) {
        const float own_step = reaches(scenes, own, lane.begin_a - scenes.half_length(own));
        const float other_step = reaches(scenes, other, lane.begin_b - scenes.half_length(other));
        if (own_step != other_step) {
            return other_step < own_step;
        }
    }
    return position(other) - lane.offset > position(own); // both were there from the first
}

bool went_first(const RecordedScenes& scenes, const Conflict& conflict, int own, int other) {
    const bool yields = conflict.yielder == scenes.route[at(own)];
    const int yielder = yields ? own : other, prioritized = yields ? other : own;
    const bool yielder_first =
        reaches(scenes, yielder, conflict.on_yielder.begin - scenes.half_length(yielder)) <
        reaches(scenes, prioritized, conflict.on_prioritized.begin - scenes.half_length(prioritized));
    return yields == yielder_first;
}

bool asks_for_stop(const RecordedScenes& scenes, const Map& map, int track, bool recording) {
    const Route& road = map.routes[at(scenes.route[at(track)])];
    if (!recording || !road.must_stop) {
        return road.must_stop;
    }
    bool has_stopped = false;
    for (long k = scenes.first_sample(track); k < scenes.end_sample(track); ++k) {
        const float to_line = road.stop_line - (scenes.position[at(k)] + scenes.half_length(track));
        if (to_line < 0.0F) {
            return has_stopped;
        }
        has_stopped |= scenes.speed[at(k)] < STOPPED && to_line < AT_LINE;
    }
    return true;
}

} // namespace intersection_env
