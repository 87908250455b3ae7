// The compiled map: routes sampled by arc length, and how routes meet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace intersection_env {

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
    int stop_lane; // routes with equal index queue in one lane before their stop lines
    Interval junction;
    float first_conflict; // where the first conflict of the route begins
    std::vector<Sample> samples;
};

// Two routes from different lanes whose swept areas overlap. The yielder's interval ends at its PGA.
struct Conflict {
    int yielder, prioritized;
    bool merging;
    Interval on_yielder, on_prioritized;
};

// Where vehicles of two routes follow each other: before `split` at equal arc lengths, beyond the
// merges with position_b = position_a + offset.
struct SharedLane {
    int a, b;
    float split, merge_a, merge_b, offset;
};

// Where vehicles of two different routes can touch.
struct Overlap {
    int a, b;
    Interval on_a, on_b;
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

    // The conflict of two routes, whichever yields; null if they have none. Likewise below.
    const Conflict* conflict(int a, int b) const;
    const SharedLane* shared_lane(int a, int b) const;
    const Overlap* overlap(int a, int b) const;

  private:
    void index(const class TextReader& reader);
    std::vector<int> conflict_index_, shared_index_, overlap_index_; // (route, route), -1: none
};

} // namespace intersection_env
