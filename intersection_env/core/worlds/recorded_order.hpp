// In which order recorded vehicles followed each other, and entered.
#pragma once

#include "intersection_env/map.hpp"
#include "worlds/recorded_scenes.hpp"

namespace intersection_env {

// Whether the other one was ahead in a lane that the two share, as the own one sees it.
bool is_ahead(const RecordedScenes& scenes, const SharedLane& lane, int own, int other);

// Whether the own one went first: a yielder whose front reached the conflict before the prioritized vehicle's front
// did, or a prioritized vehicle whose yielder did not.
bool went_first(const RecordedScenes& scenes, const Conflict& conflict, int own, int other);

// Whether it is asked for a stop at its line; recording: not if it was recorded to pass its line without one.
bool asks_for_stop(const RecordedScenes& scenes, const Map& map, int track, bool recording);

} // namespace intersection_env
