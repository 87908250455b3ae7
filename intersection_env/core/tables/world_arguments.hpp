// What a kernel is handed to start, step and roll out worlds.
#pragma once

#include <cstdint>

#include "intersection_env/policy.hpp"
#include "tables/map_tables.hpp"
#include "tables/problem.hpp"
#include "tables/recorded_rows.hpp"

namespace intersection_env {

constexpr int BLOCK = LANES; // worlds to a block, on every instruction set: the widest one's lanes

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
