// Recorded scenes as a replay needs them: who shares a scene with whom, in which order they followed and entered.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "intersection_env/map.hpp"
#include "tables/recorded_rows.hpp"

namespace intersection_env {

// As in the scenes file. One entry a scene, a track or a sample; offsets have one more.
struct RecordedScenes {
    std::vector<std::int64_t> scene_tracks, track_samples;
    std::vector<std::int32_t> route, start; // start: step of the scene at which a track appears
    std::vector<float> length, width, max_speed;
    std::vector<float> position, speed;
    std::vector<std::uint8_t> observed;

    int tracks() const { return static_cast<int>(route.size()); }
};

class Recorded {
  public:
    // recording: gap decisions and blame follow the recorded order. actors: the tracks that a start may draw.
    // Throws std::invalid_argument for arrays that contradict each other or the map.
    Recorded(const Map& map, RecordedScenes scenes, std::vector<std::int32_t> actors, bool recording);

    RecordedRows rows() const;
    float* seen() { return seen_.data(); } // SEEN_COLUMNS a sample, which a kernel fills in
    const RecordedScenes& scenes() const { return scenes_; }
    int scene_of(int track) const { return scene_[static_cast<std::size_t>(track)]; }
    int first_step(int track) const { return scenes_.start[static_cast<std::size_t>(track)]; }
    int end_step(int track) const;

  private:
    void check(const Map& map) const;
    void add_track(const Map& map, int track, bool recording);
    bool asks_for_stop(const Map& map, int track, bool recording) const;
    struct Order {
        bool follows, first; // the own one was behind in the lane, went first through the conflict
        Fault fault;
    };
    void add_companion(const Map& map, int own, int other, bool recording);
    void add_windows(int track, long first);
    void add_companion_row(const Map& map, int own, int other, const Conflict* conflict, const SharedLane* lane,
                           const Order& order);
    static Fault fault_of(const Conflict* conflict, int route, bool follows, bool first, bool recording);
    void add_samples(const Map& map);
    void add_accelerations();
    void mark_held();
    bool is_ahead(const SharedLane& lane, int own, int other) const;
    bool went_first(const Conflict& conflict, int own, int other) const;
    float reaches(int track, float arc_length) const;

    RecordedScenes scenes_;
    std::vector<std::int32_t> actors_, scene_, windows_, listed_;
    std::vector<float> acceleration_, track_rows_, sample_rows_, companion_rows_, seen_;
};

} // namespace intersection_env
