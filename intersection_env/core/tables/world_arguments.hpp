// What a kernel is handed to start, step and roll out worlds.
#pragma once

#include <cstdint>

#include "intersection_env/policy.hpp"
#include "model/contact.hpp"
#include "tables/map_tables.hpp"
#include "tables/problem.hpp"
#include "tables/recorded_rows.hpp"
#include "tables/world_fields.hpp"

namespace intersection_env {

// A policy and a value network inside a rollout, and where its results go: (world, step, vehicle[, feature]).
struct Rollout {
    const DrivingNetwork *policy, *value;
    float sigma, log_sigma;
    float *observation, *latent, *log_probability, *value_now, *value_next, *reward;
    std::uint8_t *terminated, *cut; // cut: terminated, truncated or reinserted
};

enum class Task : std::uint8_t { start, step, look, rollout, watch };

// One block of closed-loop worlds. State: (vehicle, WORLDS_PER_BLOCK), or (WORLDS_PER_BLOCK,), (8, WORLDS_PER_BLOCK)
// for the streams; buffers from the block's first world on.
struct ClosedLoopArguments {
    MapRows map;
    Gap gap;
    const GapNetwork* gap_network;
    float acceleration_scale;
    Bodies bodies;
    int vehicles, max_cycles;
    Task task;
    int steps;        // of a rollout
    long first_world; // of the block
    int first_lane;
    int worlds;                 // of this block that exist
    const std::int32_t* listed; // the worlds to start, as many as lanes at most; pointers are then those of world 0
    int listed_count;
    bool desynchronise; // cycles of a start begin at random

    ClosedLoopState<Pointer> state;
    ClosedLoopBuffers<Pointer> buffers;
    const Rollout* rollout;
};

// Replay worlds from `first_world` on, as many as lanes at most. Arrays are (world,) unless said otherwise.
struct ReplayArguments {
    MapRows map;
    RecordedRows recorded;
    bool recording; // gap decisions from the recorded order
    Gap gap;
    const GapNetwork* gap_network;
    float acceleration_scale;
    Bodies bodies;
    Task task;
    int steps; // of a rollout
    long first_world;
    int worlds;                 // that exist from first_world on
    const std::uint8_t* wanted; // the worlds to start; null: none but those of a rollout that end
    const std::int32_t* given;  // the track to start with, or -1: drawn; or to watch
    std::int32_t* seen;         // one a sample, of what is watched ...
    bool by_arrival;            // ... where some wait for who arrived first: what they decided before then matters
    bool desynchronise;         // begin anywhere within the track

    ReplayState<Pointer> state; // random: (8, padded worlds)
    long padded;
    ReplayBuffers<Pointer> buffers;
    const Rollout* rollout;
};

} // namespace intersection_env
