// The compiled map: routes sampled by arc length, and how routes meet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace intersection_env {

constexpr int MOST_ROUTES_OF_A_MAP = 256;

// One point of a route. Lengths [m], angles [rad] (unwrapped along the route), speeds [m/s].
struct Sample {
    float x, y, heading, width, v_max;
    std::array<float, 6> relative_heading; // at the map's heading offsets; paper, Table I
};

struct Interval {
    float begin, end;
};

struct Route {
    std::string id;
    float length;
    float stop_line;
    bool must_stop; // a stop is made before that line
    int stop_lane;  // routes with equal index queue in one lane before their stop lines
    Interval junction;
    float first_conflict; // where the first conflict of the route begins
    std::vector<Sample> samples;
    int rank = 0; // whom a vehicle that waits still holds up (docs/model.md, "Ranks"); from 0, each once
};

// Two routes whose swept areas overlap outside of what lanes they share. The yielder's interval ends at its PGA.
struct Conflict {
    int yielder, prioritized;
    bool merging;
    bool by_arrival; // who arrived first at an all-way stop goes first; the yielder only waits on a tie
    Interval on_yielder, on_prioritized;
    float line; // on the prioritized route: how far that vehicle still has to go is measured to there
};

// A stretch on which vehicles of two routes follow each other: from begin_a on a and begin_b on b to `end` on a, with
// position_b = position_a + offset.
struct SharedLane {
    int a, b;
    float begin_a, begin_b, end, offset;

    // The same with `route` as a.
    SharedLane seen_from(int route) const {
        return route == a ? *this : SharedLane{b, a, begin_b, begin_a, end + offset, -offset};
    }
};

// Where vehicles of two different routes can touch.
struct Overlap {
    int a, b;
    Interval on_a, on_b;

    Overlap seen_from(int route) const { return route == a ? *this : Overlap{b, a, on_b, on_a}; }
};

struct Map {
    std::string name;
    std::vector<int> locations;
    float spacing;
    std::vector<float> heading_offsets;
    std::vector<Route> routes;
    std::vector<Conflict> conflicts;
    std::vector<SharedLane> shared_lanes;
    std::vector<Overlap> overlaps;
    std::uint32_t checksum;

    // Throws FormatError.
    static Map read(const std::string& path);
    static Map parse(std::string text, std::string where);

    // The sample at an arc length, interpolated; the end values hold beyond the ends.
    Sample at(int route, float position) const;

    // The conflict in which one route yields to the other; null if there is none.
    const Conflict* conflict(int yielder, int prioritized) const;
    // What two routes share, and where they overlap, in whichever order they are named.
    std::span<const SharedLane> shared_lanes_of(int a, int b) const;
    std::span<const Overlap> overlaps_of(int a, int b) const;

    // Whether somebody has to make a stop.
    bool has_stops() const { return has_stops_; }

  private:
    struct Rows {
        int first, count;
    };
    void index(const class TextReader& reader);
    std::vector<Rows> conflict_rows_, shared_rows_, overlap_rows_; // (route, route)
    bool has_stops_ = false;
};

} // namespace intersection_env
