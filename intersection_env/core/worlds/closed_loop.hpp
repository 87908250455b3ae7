// Many closed-loop worlds of one intersection, stepped together on buffers that outlive a step.
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
#include "worlds/zeroed.hpp"

namespace intersection_env {

class ClosedLoop {
  public:
    // Throws std::invalid_argument for numbers that are out of range.
    ClosedLoop(std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles, int max_cycles, Bodies bodies,
               Autoreset autoreset, int threads, const Kernel& kernel);
    ~ClosedLoop();
    ClosedLoop(const ClosedLoop&) = delete;
    ClosedLoop& operator=(const ClosedLoop&) = delete;

    int worlds() const { return worlds_; }
    int vehicles() const { return vehicles_; }
    // Whether one short row says what two routes are to each other, which is faster.
    bool is_plain() const { return tables_.rows().links == nullptr; }

    // World after world; the next step overwrites them.
    using Buffers = ClosedLoopBuffers<Zeroed>;
    Buffers buffers;

    // Throw std::runtime_error where no start without a violated constraint is found, before a first reset, and
    // while another thread is in such a call.
    void reset(std::uint64_t seed, bool desynchronise);
    void reset_worlds(std::span<const std::uint8_t> wanted);
    void step();
    // Results are (world, steps, vehicle[, feature]); needs autoreset same_step.
    void rollout(const Rollout& rollout, int steps);

    // The whole state, world after world, as the kernel keeps the numbers.
    using State = ClosedLoopState<Values>;
    State state() const;
    // Throws std::invalid_argument for sizes or values that are no state of these worlds.
    void set_state(const State& state);

  private:
    ClosedLoopArguments arguments(long block, Task task);
    void run(Task task, const Rollout* rollout = nullptr, int steps = 0);
    void start(const std::vector<std::int32_t>& listed, bool desynchronise);
    void restart(const std::vector<std::int32_t>& listed, bool desynchronise);
    std::vector<std::int32_t> ended() const;
    [[noreturn]] void refuse_start() const;
    void check(const State& state) const;
    void check_started() const;

    MapTables tables_;
    Policy policy_;
    int worlds_, vehicles_, max_cycles_, blocks_;
    Bodies bodies_;
    Autoreset autoreset_;
    const Kernel& kernel_;
    Threads threads_;
    std::vector<Workspace*> workspaces_; // one a thread

    bool started_ = false;
    std::atomic_flag held_;
    ClosedLoopState<LaneVector> state_; // (block, vehicle, WORLDS_PER_BLOCK)
};

} // namespace intersection_env
