// Many replay worlds: in each, one vehicle of a recorded scene acts among the recorded others.
#pragma once

#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "kernel/dispatch.hpp"
#include "tables/map_tables.hpp"
#include "threads.hpp"
#include "worlds/autoreset.hpp"
#include "worlds/fields.hpp"
#include "worlds/recorded.hpp"
#include "worlds/zeroed.hpp"

namespace intersection_env {

class Replay {
  public:
    // Throws std::invalid_argument for numbers that are out of range, or scenes that are refused.
    Replay(std::shared_ptr<const Map> map, Policy policy, bool recording, const RecordedScenes& scenes,
           std::vector<std::int32_t> actors, int worlds, Bodies bodies, Autoreset autoreset, int threads,
           const Kernel& kernel);
    ~Replay();
    Replay(const Replay&) = delete;
    Replay& operator=(const Replay&) = delete;

    int worlds() const { return worlds_; }
    int vehicles() const { return 1; } // that act in a world

    // World after world; the next step overwrites them.
    using Buffers = ReplayBuffers<Zeroed>;
    Buffers buffers;

    // Throw std::runtime_error before a first reset, and while another thread is in such a call.
    void reset(std::uint64_t seed, bool desynchronise);
    void reset_worlds(std::span<const std::uint8_t> wanted);
    // Begins one world's episode with a given track. Throws std::invalid_argument.
    void start(int world, int track);
    void step();
    // Results are (world, steps[, feature]); needs autoreset same_step.
    void rollout(const Rollout& rollout, int steps);

    // The whole state, world after world, as the kernel keeps the numbers.
    using State = ReplayState<Values>;
    State state() const;
    // Throws std::invalid_argument for sizes or values that are no state of these worlds.
    void set_state(const State& state);

  private:
    ReplayArguments arguments(Task task) const;
    void share(int count, const ReplayArguments& shared);
    void watch();
    void run(Task task, const std::uint8_t* wanted = nullptr, const std::int32_t* given = nullptr,
             bool desynchronise = false, const Rollout* rollout = nullptr, int steps = 0);
    void restart(std::span<const std::uint8_t> wanted, const std::int32_t* given, bool desynchronise);
    std::vector<std::uint8_t> ended() const;
    void check(const State& state) const;
    void check_started() const;
    long place(long world, long k) const { return k * padded_ + world; } // of a world's k-th number in the state

    MapTables tables_;
    Policy policy_;
    Recorded recorded_;
    bool recording_;
    int worlds_;
    Bodies bodies_;
    long padded_; // worlds, up to whole blocks
    Autoreset autoreset_;
    const Kernel& kernel_;
    Threads threads_;
    std::vector<Workspace*> workspaces_; // one a thread

    bool started_ = false;
    std::atomic_flag held_;
    ReplayState<LaneVector> state_; // (padded,), random (8, padded)
};

} // namespace intersection_env
