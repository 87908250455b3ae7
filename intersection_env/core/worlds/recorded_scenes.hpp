// The scenes that a replay is made of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/map.hpp"

namespace intersection_env {

// As in the scenes file, in somebody else's memory. One entry a scene, a track or a sample; offsets have one more.
struct RecordedScenes {
    std::span<const std::int64_t> scene_tracks, track_samples;
    std::span<const std::int32_t> route, start; // start: step of the scene at which a track appears
    std::span<const float> length, width, max_speed;
    std::span<const float> position, speed;
    std::span<const bool> observed;

    int tracks() const { return static_cast<int>(route.size()); }
    long samples() const { return static_cast<long>(position.size()); }
    long first_sample(int track) const { return track_samples[static_cast<std::size_t>(track)]; }
    long end_sample(int track) const { return track_samples[static_cast<std::size_t>(track) + 1]; }
    int first_step(int track) const { return start[static_cast<std::size_t>(track)]; }
    int end_step(int track) const {
        return first_step(track) + static_cast<int>(end_sample(track) - first_sample(track));
    }
    float half_length(int track) const { return 0.5F * length[static_cast<std::size_t>(track)]; }
};

constexpr long MOST_RECORDED_ROWS = 1L << 24; // beyond it floats do not count

// actors: the tracks that a start may draw. Throws std::invalid_argument for arrays that contradict each other or the
// map.
void check(const Map& map, const RecordedScenes& scenes, const std::vector<std::int32_t>& actors);

[[noreturn]] void refuse_scenes(const char* what);

} // namespace intersection_env
