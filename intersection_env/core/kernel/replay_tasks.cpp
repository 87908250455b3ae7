// Starts, steps and rolls out replay worlds: in each lane one vehicle of a recorded scene acts, all others are
// recorded.
#include "kernel/kernel.hpp"
#include "kernel/worlds/replay_step.hpp"
#include "kernel/worlds/results.hpp"
#include "kernel/worlds/rollout.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

template <class Number>
using LanesPointer = LanesOf<Number>*;

ReplayState<LanesPointer> state_of(ReplayLanes& run) {
    return {.track = &run.track,
            .time = &run.time,
            .position = &run.own.position,
            .speed = &run.own.speed,
            .acceleration = &run.own.acceleration,
            .delta = &run.own.delta,
            .expert_delta = &run.expert_delta,
            .waited = &run.own.waited,
            .ended = &run.ended,
            .random = run.random.s};
}

// visit(lanes in memory, lanes of the run) for the whole state, the stream of sampled actions left out.
template <class Visit>
void for_each_row(const ReplayArguments& g, ReplayLanes& run, const Visit& visit) {
    const ReplayState<LanesPointer> lanes = state_of(run);
    ReplayState<Pointer>::for_each<ReplayState<LanesPointer>>([&](const auto& field, auto in_memory, auto in_run) {
        for (long row = 0; row < (field.per == Per::word ? STREAM_WORDS : 1); ++row) {
            visit(lanes_at(g.state.*in_memory + row * g.padded + g.first_world), (lanes.*in_run)[row]);
        }
    });
}

unsigned used(const ReplayArguments& g) { return used_lanes(g.worlds); }

void load(const ReplayArguments& g, ReplayLanes& run) {
    for_each_row(g, run, [](const auto& in_memory, auto& in_run) { in_run = in_memory; });
    run.exists = lane_numbers() < g.worlds;
    load_track(g, run);
    run.own.hold = all_ints(-1);
}

void store(const ReplayArguments& g, Ints changed, ReplayLanes& run) {
    for_each_row(g, run, [&](auto& in_memory, const auto& in_run) { in_memory = changed ? in_run : in_memory; });
}

void write_seen(const ReplayArguments& g, unsigned lanes, const ReplayLanes& run) {
    Floats features[FEATURES];
    driving_features(run.own, features);
    store_rows<3>(features, g.buffers.observation + g.first_world * FEATURES, FEATURES, lanes);
    driving_features(recalled(g, run), features);
    store_rows<3>(features, g.buffers.expert_observation + g.first_world * FEATURES, FEATURES, lanes);
    const Floats acceleration = recorded_acceleration(g, run);
    store_columns(&acceleration, 1, g.buffers.expert_acceleration + g.first_world, 1, lanes);
}

void run_start(const ReplayArguments& g, ReplayLanes& run) {
    Ints wanted{}, given = all_ints(-1);
    for (int l = 0; l < WIDTH && l < g.worlds; ++l) {
        wanted[l] = g.wanted[g.first_world + l] != 0 ? -1 : 0;
        given[l] = g.given != nullptr ? g.given[g.first_world + l] : -1;
    }
    if (!any(wanted)) {
        return;
    }
    load(g, run);
    begin(g, wanted, given, run);
    look_again(g, wanted, run);
    store(g, wanted, run);
    write_seen(g, used(g) & bits(wanted), run);
}

void run_step(const ReplayArguments& g, ReplayLanes& run) {
    const unsigned lanes = used(g);
    load(g, run);
    const Ints ran = ~run.ended;
    load_columns(g.buffers.action + g.first_world, 1, 1, lanes, &run.action);
    const Ints ends = step(g, run);
    const unsigned over = lanes & bits(ran & ends), blamed = over & bits(run.collided);
    for (std::uint8_t* flags : {g.buffers.terminated, g.buffers.truncated}) {
        clear_flags(flags + g.first_world, 1, lanes, 1);
    }
    set_flags(g.buffers.terminated + g.first_world, 1, blamed);
    set_flags(g.buffers.truncated + g.first_world, 1, over & ~blamed);
    if (over != 0) {
        store_rows<3>(run.last_features, g.buffers.final_observation + g.first_world * FEATURES, FEATURES, over);
    }
    const Floats paid = ran ? run.step_reward : all(0.0F);
    store_columns(&paid, 1, g.buffers.reward + g.first_world, 1, lanes);
    run.ended |= ends;
    store(g, ran, run);
    write_seen(g, lanes & bits(ran), run);
    if (over != 0) { // where it ended, the observation is the last one too, until the next start
        store_rows<3>(run.last_features, g.buffers.observation + g.first_world * FEATURES, FEATURES, over);
    }
}

void run_look(const ReplayArguments& g, ReplayLanes& run) {
    load(g, run);
    look_again(g, Ints{}, run);
    write_seen(g, used(g), run);
}

// What a rollout asks of the worlds, in each of which one vehicle acts.
struct RolledOut {
    const ReplayArguments& g;
    ReplayLanes& run;

    static constexpr int vehicles() { return 1; }
    void observe(int, Floats* features) const { driving_features(run.own, features); }
    void observe_last(int, Floats* features) const {
        for (int f = 0; f < FEATURES; ++f) {
            features[f] = run.last_features[f];
        }
    }
    Floats* action() { return &run.action; }
    const Floats* paid() const { return &run.step_reward; }
    Ints step() { return INTERSECTION_ENV_ISA::step(g, run) & run.exists; }
    Ints left(int) const { return Ints{}; } // it ends its world, and so is among those that end
    Ints blamed(int) const { return run.collided; }
    bool restart(Ints ended) {
        begin(g, ended, all_ints(-1), run);
        look_again(g, ended, run);
        return true;
    }
};

void run_rollout(const ReplayArguments& g, ReplayLanes& run) {
    load(g, run);
    look_again(g, Ints{}, run);
    Random noise;
    for (int k = 0; k < STREAM_WORDS; ++k) {
        noise.s[k] = lanes_at(g.state.random + (STREAM_WORDS + k) * g.padded + g.first_world);
    }
    RolledOut worlds{g, run};
    roll_out(*g.rollout, g.steps, g.first_world, used(g), noise, worlds);
    store(g, all_ints(-1), run);
    for (int k = 0; k < STREAM_WORDS; ++k) {
        lanes_at(g.state.random + (STREAM_WORDS + k) * g.padded + g.first_world) = noise.s[k];
    }
    write_seen(g, used(g), run);
}

} // namespace

Workspace* create_replay() { return reinterpret_cast<Workspace*>(new ReplayLanes()); }
void destroy_replay(Workspace* workspace) { delete reinterpret_cast<ReplayLanes*>(workspace); }

void run_replay(const ReplayArguments& g, Workspace& workspace) {
    ReplayLanes& run = reinterpret_cast<ReplayLanes&>(workspace);
    switch (g.task) {
    case Task::start:
        return run_start(g, run);
    case Task::step:
        return run_step(g, run);
    case Task::look:
        return run_look(g, run);
    case Task::rollout:
        return run_rollout(g, run);
    case Task::watch:
        return watch(g, run);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
