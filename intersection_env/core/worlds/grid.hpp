// Where recorded vehicles are, and come to stand once they have braked: roughly, in little memory.
#pragma once

#include <cstdint>

#include "intersection_env/map.hpp"
#include "tables/recorded_rows.hpp"
#include "worlds/recorded_scenes.hpp"

namespace intersection_env {

// Where a vehicle stands once it has braked [m].
float braked(float position, float speed);

// The finest that reaches around all these places.
Grid grid_around(const Map& map, const RecordedScenes& scenes);

// A place on it, x in the lower half and y in the upper one.
std::int32_t on_grid(const Grid& grid, float x, float y);

} // namespace intersection_env
