// The vehicles at one moment, and who must look out for whom.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "intersection_env/map.hpp"

namespace intersection_env {

constexpr int MAX_VEHICLES = 64; // ours: one machine word of bits in the order search
constexpr float LEAST_SIZE = 0.1F, MOST_LENGTH = 50.0F, MOST_WIDTH = 10.0F; // [m], ours: longer than any road train
constexpr float MOST_SPEED = 100.0F;                                        // [m/s], ours: faster is a unit mistaken
constexpr std::int32_t MOST_WAITED = 1 << 20;                               // steps, ours: more than two days
constexpr float BRAKING = 4.0F; // [m/s²], paper, Eq. (3): full braking in the reward and the stop-line test
constexpr float DRIVES =
    1.0F; // [m/s], ours: slower than this a vehicle beyond its line, but before its conflicts, waits

// One entry a vehicle. Positions are arc lengths of vehicle centres [m], speeds [m/s], sizes [m].
struct Traffic {
    std::vector<int> route;
    std::vector<float> position, speed, length, width;
    std::vector<float> max_speed; // the vehicle's own top speed
    // What each vehicle remembers from a prediction: whether it enters, and whom it lets go while it waits itself:
    // yielders of routes below that rank (-1: nobody). Both empty: docs/model.md, "Memories at the start".
    std::vector<std::uint8_t> delta{};
    std::vector<std::int16_t> hold{};
    // For how many steps each vehicle has stopped at its line or gone on from there; 0: not yet. Empty: nobody has.
    std::vector<std::int32_t> waited{};
    // The logit that the gap network's must exceed before this driver accepts a gap: 0 for the median
    // driver. Empty: docs/model.md, "Patience".
    std::vector<float> patience{};

    int count() const { return static_cast<int>(route.size()); }
    bool has_memories() const { return !hold.empty(); }
    std::int32_t steps_waited(int i) const { return waited.empty() ? 0 : waited[static_cast<std::size_t>(i)]; }
    bool has_patience() const { return !patience.empty(); }
    float front(int i) const {
        return position[static_cast<std::size_t>(i)] + 0.5F * length[static_cast<std::size_t>(i)];
    }
    float rear(int i) const {
        return position[static_cast<std::size_t>(i)] - 0.5F * length[static_cast<std::size_t>(i)];
    }
};

// Throws std::invalid_argument, naming the vehicle's index and what is wrong with it.
void check(const Map& map, const Traffic& traffic);

// Indices of two vehicles: the one that yields by rule, and the one it yields to.
struct Pair {
    int yielder, prioritized;
};

// The pairs still open, sorted by yielder, then prioritized.
std::vector<Pair> find_conflicts(const Map& map, const Traffic& traffic);
void find_conflicts(const Map& map, const Traffic& traffic, std::vector<Pair>& found); // into memory that is there

// For each vehicle in a stop lane, before its line or standing past it undecided, the next one behind it there.
std::vector<Pair> lane_order(const Map& map, const Traffic& traffic); // {ahead, behind}
void lane_order(const Map& map, const Traffic& traffic, std::vector<Pair>& order);

// Whether a vehicle is past stopping at its line and does not wait beyond it; with memories, and has decided to go.
bool committed(const Map& map, const Traffic& traffic, int vehicle);

// The smallest distance between the bodies, rigid rectangles, of two vehicles that can touch, and which two; nothing if
// none can. 0: they overlap.
struct Closest {
    float distance;
    int a, b;
};
std::optional<Closest> closest(const Map& map, const Traffic& traffic);

// All pairs of vehicles whose bodies overlap, as perception may have it; sorted.
std::vector<std::pair<int, int>> overlaps(const Map& map, const Traffic& traffic);

// The vehicles, by index, that are more than twice as fast as the map allows where they are: their speeds can only be
// km/h.
std::vector<int> doubted_speeds(const Map& map, const Traffic& traffic);

// The first two vehicles that collide as the worlds understand it, by two circles each or by "rectangles": now, or once
// both have braked fully. Throws std::invalid_argument for other bodies.
std::optional<std::pair<int, int>> collision(const Map& map, const Traffic& traffic,
                                             const std::string& bodies = "circles");

} // namespace intersection_env
