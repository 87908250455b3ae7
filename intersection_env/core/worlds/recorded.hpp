// Recorded scenes as a replay needs them: who shares a scene with whom, and what each can have to do with the other.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "intersection_env/map.hpp"
#include "tables/recorded_rows.hpp"
#include "worlds/recorded_scenes.hpp"

namespace intersection_env {

class Recorded {
  public:
    // recording: gap decisions and blame follow the recorded order; actors: the tracks that a start may draw;
    // needs_v_max: gap decisions ask for it. Throws std::invalid_argument for scenes that `check` refuses.
    Recorded(const Map& map, const RecordedScenes& scenes, std::vector<std::int32_t> actors, bool recording,
             bool needs_v_max);

    RecordedRows rows() const;
    std::int32_t* seen() { return seen_.data(); } // one a sample, which a kernel that watches fills in

    int tracks() const { return static_cast<int>(tracks_.size()) / TRACK_COLUMNS; }
    int first_step(int track) const { return step(track, 5); }
    int end_step(int track) const { return step(track, 6); }

  private:
    // What it is made from.
    struct Source {
        const Map& map;
        const RecordedScenes& scenes;
        bool recording;
    };
    struct Order {
        bool follows, first; // the own one was behind in the lane, went first through the conflict
        Fault fault;
    };
    void add_samples(const Source& from);
    void add_v_max(const Source& from);
    void add_companions_in_scene(const Source& from, int scene, int track);
    void add_companions(const Source& from, int own, int other);
    void add_companion(const Source& from, int own, int other, const Conflict* conflict, const SharedLane* lane,
                       const Order& order);
    void add_track(const Source& from, int track);
    void add_windows(const Source& from, int track, std::span<const float> companions);
    void mark_held(const Source& from, int track, std::span<const float> companions);
    long companions() const { return static_cast<long>(companions_.size()) / COMPANION_COLUMNS; }
    int step(int track, int column) const {
        return static_cast<int>(tracks_[static_cast<std::size_t>(track * TRACK_COLUMNS + column)]);
    }

    std::vector<std::int32_t> actors_, windows_, listed_, seen_;
    std::vector<float> tracks_, samples_, v_max_, companions_;
    Grid grid_{};
};

} // namespace intersection_env
