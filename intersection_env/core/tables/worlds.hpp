// What worlds share: the map as flat tables, the layout of their state, and what a kernel needs to run a block of them.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"
#include "tables/problem.hpp"
#include "tables/route_tables.hpp"

namespace intersection_env {

constexpr int BLOCK = LANES;   // worlds to a block, on every instruction set: the widest one's lanes
constexpr int MAX_ROUTES = 32; // ours: one machine word of bits says which routes overlap

constexpr int ROUTE_COLUMNS =
    8; // stop line, length, first conflict, first row, last row, stop lane, overlaps (2 x 16 bits)
constexpr int PAIR_COLUMNS = 4; // what two routes are to each other, in one quad:
// where they conflict, the ends of the conflict on the own and on the other route (where they merge, if they do), the
// other's offset in the lane after a merge, and 1 crossing or 2 merging, negative where the other route yields;
// where they share the lane before a split, 0, 0, the split and SHARED_ENTRY; else zeros
constexpr float SHARED_ENTRY = 3.0F;

// The map, row by row, for lanes that each have a route of their own. Pointers only, as the kernel wants it.
struct Tables {
    const Map* map;
    const float* observed; // (row, OBSERVED_COLUMNS)
    const float* points;   // (row, 4): x, y, and how much they grow to the next row
    const float* routes;   // (route, ROUTE_COLUMNS)
    const float* pairs;    // (route, route, PAIR_COLUMNS)
    int route_count;
    float inverse_spacing;
};

// Owns what Tables points to.
class MapTables {
  public:
    // Throws std::invalid_argument for a map of more than MAX_ROUTES routes, or with a merge that is no conflict.
    explicit MapTables(std::shared_ptr<const Map> map);

    const Map& map() const { return *map_; }
    Tables tables() const;

  private:
    std::shared_ptr<const Map> map_;
    RouteTables rows_;
    std::vector<float> points_, routes_, pairs_;
};

enum class Autoreset : std::uint8_t { off, same_step, next_step };

// Throws std::invalid_argument for a name that is none.
Autoreset autoreset_named(std::string_view name);

// A policy and a value network inside a rollout, and where its results go: (world, step, vehicle[, feature]).
struct Rollout {
    const DrivingNetwork *policy, *value;
    float sigma, log_sigma;
    float *observation, *latent, *log_probability, *value_now, *value_next, *reward;
    std::uint8_t *terminated, *cut; // cut: terminated, truncated or reinserted
};

enum class Task : std::uint8_t { start, step, look, rollout };

// One block of closed-loop worlds. State: (vehicle, BLOCK), or (BLOCK,), (8, BLOCK) for the streams; results of the
// block's first world on.
struct ClosedLoopArguments {
    Tables tables;
    Gap gap;
    const GapNetwork* gap_network;
    float acceleration_scale;
    int vehicles, max_cycles;
    Task task;
    int steps; // of a rollout
    int first_lane;
    int worlds;                 // of this block that exist
    const std::int32_t* listed; // the worlds to start, as many as lanes at most; pointers are then those of world 0
    int listed_count;
    bool desynchronise; // cycles of a start begin at random

    float *position, *speed, *half_length, *half_width, *max_speed, *acceleration;
    std::int32_t *route, *delta, *hold, *cycle;
    std::uint32_t* random;
    std::int32_t* ended; // masks

    const float* action;
    float *observation, *final_observation, *reward;
    std::uint8_t *terminated, *truncated, *reinserted, *done;
    const Rollout* rollout;
};

// Recorded scenes as tables of rows; whole numbers are exact in float below 2^24.
constexpr int TRACK_COLUMNS = 12;
// route, half length, half width, top speed, first sample, first step, end step, first recorded step,
// first companion, companion count, 0, 0
constexpr int SAMPLE_COLUMNS = 8; // position, speed, held (mask as -1 or 0), v_max, x, y, x and y once braked
constexpr int COMPANION_COLUMNS = 16;
// split, other's merge, offset, may lead; own end, other's end, kind of conflict in which the own one yields (0 none,
// 1 crossing, 2 merging), went first; fault, other's stop line, half length, half width; other's first sample, first
// step, end step, route

// When a collision with a companion is the acting vehicle's fault.
enum class Fault : std::uint8_t { never, always, before_own_end, past_other_end };

struct RecordedTables {
    const float *tracks, *samples, *companions, *acceleration;
    const std::int32_t* actors;
    int actor_count;
};

// Replay worlds from `first_world` on, as many as lanes at most. Arrays are (world,) unless said otherwise.
struct ReplayArguments {
    Tables tables;
    RecordedTables recorded;
    bool recording; // gap decisions from the recorded order
    Gap gap;
    const GapNetwork* gap_network;
    float acceleration_scale;
    Task task;
    int steps; // of a rollout
    long first_world;
    int worlds;                 // that exist from first_world on
    const std::uint8_t* wanted; // the worlds to start; null: none but those of a rollout that end
    const std::int32_t* given;  // the track to start with, or -1: drawn
    bool desynchronise;         // begin anywhere within the track

    float *position, *speed, *acceleration;
    std::int32_t *track, *time, *delta, *expert_delta, *ended;
    std::uint32_t* random; // (8, padded worlds)
    long padded;

    const float* action;
    float *observation, *final_observation, *reward, *expert_observation, *expert_acceleration;
    std::uint8_t *terminated, *truncated;
    const Rollout* rollout;
};

} // namespace intersection_env
