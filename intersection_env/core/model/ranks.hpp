// Ranks of routes: whom a vehicle that waits itself still holds up.
#pragma once

#include "intersection_env/map.hpp"

namespace intersection_env {

// Sets the rank of every route (docs/model.md, "Ranks").
void rank_routes(Map& map);

} // namespace intersection_env
