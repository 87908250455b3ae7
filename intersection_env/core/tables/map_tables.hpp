// The map, row by row, for lanes that each have a route of their own.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "intersection_env/map.hpp"
#include "tables/route_tables.hpp"

namespace intersection_env {

constexpr int MOST_ROUTES_OF_WORLDS = 32; // ours: one machine word of bits says which routes overlap

constexpr int ROUTE_COLUMNS =
    8; // stop line, length, first conflict, first row, last row, rank and stop lane, overlaps (2 x 16 bits)
// Rank and stop lane are one number: rank * MOST_ROUTES_OF_A_MAP + stop lane.
constexpr int PAIR_COLUMNS = 4; // what two routes are to each other, in one quad:
// where they conflict, the ends of the conflict on the own and on the other route (where they merge, if they do), the
// other's offset in the lane after a merge, and 1 crossing or 2 merging, negative where the other route yields;
// where they share the lane before a split, 0, 0, the split and SHARED_ENTRY; else zeros
constexpr float SHARED_ENTRY = 3.0F;

// Where that does not say it all: several rows for two routes, each with a conflict, a lane they share, or both.
constexpr int LINK_COLUMNS = 12;
// ends of the conflict on the own and on the other route; 0 none, 1 crossing, 2 merging, negative where the other route
// yields; the line of the one that goes first; where the other has to be to lead, and where the own one; the end of the
// lane on the own route, the other's offset; 1 where who arrived first goes first
constexpr int MOST_LINKS = 2;

// Pointers only, as the kernel wants it.
struct MapRows {
    const Map* whole;
    const float* observed; // (row, OBSERVED_COLUMNS)
    const float* points;   // (row, 4): x, y, and how much they grow to the next row
    const float* routes;   // (route, ROUTE_COLUMNS)
    const float* pairs;    // (route, route, PAIR_COLUMNS), or null where there are links
    const float* links;    // (route, route, link_count, LINK_COLUMNS), or null
    int route_count, link_count;
    std::uint32_t stops; // one bit a route: a stop has to be made
    float inverse_spacing;
};

// Owns what MapRows points to.
class MapTables {
  public:
    // Throws std::invalid_argument for a map of more than MOST_ROUTES_OF_WORLDS routes.
    explicit MapTables(std::shared_ptr<const Map> map);

    const Map& map() const { return *map_; }
    MapRows rows() const;

  private:
    void add_pairs();

    std::shared_ptr<const Map> map_;
    RouteTables route_tables_;
    std::vector<float> points_, routes_, pairs_, links_;
    int link_count_ = 0;
    std::uint32_t stops_ = 0;
};

} // namespace intersection_env
