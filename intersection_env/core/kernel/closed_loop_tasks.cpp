// Starts, steps and rolls out a block of closed-loop worlds.
#include "kernel/kernel.hpp"
#include "kernel/worlds/closed_loop_step.hpp"
#include "kernel/worlds/results.hpp"
#include "kernel/worlds/rollout.hpp"
#include "kernel/worlds/start.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

// The row-th row of lanes of a block's field.
template <class Number>
LanesOf<Number>& row_at(Number* field, const ClosedLoopArguments& g, long row) {
    return lanes_at(field + row * WORLDS_PER_BLOCK + g.first_lane);
}

unsigned used(const ClosedLoopArguments& g) { return used_lanes(g.worlds - g.first_lane); }

void load(const ClosedLoopArguments& g, World& world) {
    for (int i = 0; i < g.vehicles; ++i) {
        Slot& slot = world.slots[i];
        ClosedLoopState<Pointer>::for_each_of_vehicles<Slot>(
            [&](const auto&, auto field, auto in_slot) { slot.*in_slot = row_at(g.state.*field, g, i); });
        load_route(g.map, slot);
    }
    for (int k = 0; k < STREAM_WORDS; ++k) {
        world.random.s[k] = row_at(g.state.random, g, k);
    }
    world.cycle = row_at(g.state.cycle, g, 0);
    world.exists = lane_numbers() < g.worlds - g.first_lane;
}

void store(const ClosedLoopArguments& g, Ints changed, const World& world) {
    const auto put = [&](auto& target, const auto& source) { target = changed ? source : target; };
    for (int i = 0; i < g.vehicles; ++i) {
        const Slot& slot = world.slots[i];
        ClosedLoopState<Pointer>::for_each_of_vehicles<Slot>(
            [&](const auto&, auto field, auto in_slot) { put(row_at(g.state.*field, g, i), slot.*in_slot); });
    }
    for (int k = 0; k < STREAM_WORDS; ++k) {
        put(row_at(g.state.random, g, k), world.random.s[k]);
    }
    put(row_at(g.state.cycle, g, 0), world.cycle);
}

template <class Value>
Value* from_lane(Value* results, const ClosedLoopArguments& g, long per_world) {
    return results + g.first_lane * per_world;
}

void write_observation(const ClosedLoopArguments& g, const World& world, unsigned wanted) {
    for (int i = 0; i < g.vehicles; ++i) {
        Floats features[FEATURES];
        driving_features(world.slots[i], features);
        store_rows<3>(features, from_lane(g.buffers.observation, g, g.vehicles * FEATURES) + i * FEATURES,
                      g.vehicles * FEATURES, wanted);
    }
}

void write_results(const ClosedLoopArguments& g, ClosedLoopLanes& run, Ints ran, Ints ends) {
    const unsigned wanted = used(g), written = wanted & bits(ran), ended = written & bits(ends);
    const long stride = g.vehicles;
    for (std::uint8_t* flags : {g.buffers.terminated, g.buffers.truncated, g.buffers.reinserted}) {
        clear_flags(from_lane(flags, g, stride), stride, wanted, g.vehicles);
    }
    clear_flags(from_lane(g.buffers.done, g, 1), 1, wanted, 1);
    set_flags(from_lane(g.buffers.done, g, 1), 1, ended);
    for (int i = 0; i < g.vehicles; ++i) {
        run.step_reward[i] = ran ? run.step_reward[i] : all(0.0F);
        const unsigned cut = written & (ended | bits(run.world.slots[i].left));
        if (cut == 0) {
            continue;
        }
        const unsigned blamed = ended & bits(run.world.slots[i].blamed);
        set_flags(from_lane(g.buffers.terminated, g, stride) + i, stride, blamed);
        set_flags(from_lane(g.buffers.truncated, g, stride) + i, stride, ended & ~blamed);
        set_flags(from_lane(g.buffers.reinserted, g, stride) + i, stride, cut & ~ended);
        Floats features[FEATURES];
        final_features(run, i, features);
        store_rows<3>(features, from_lane(g.buffers.final_observation, g, stride * FEATURES) + i * FEATURES,
                      stride * FEATURES, cut);
    }
    store_columns(run.step_reward, g.vehicles, from_lane(g.buffers.reward, g, stride), stride, wanted);
}

// What the state says, seen again; decisions stay as they are.
template <Gap GAP>
void look(const ClosedLoopArguments& g, World& world) {
    Ints delta[MAX_VEHICLES], hold[MAX_VEHICLES], waited[MAX_VEHICLES];
    for (int i = 0; i < g.vehicles; ++i) {
        delta[i] = world.slots[i].delta;
        hold[i] = world.slots[i].hold;
        waited[i] = world.slots[i].waited;
        observe_vehicle(g.map, world.slots[i]);
    }
    decide<GAP>(g.map, g.gap_network, g.vehicles, Bodies::unseen, world);
    for (int i = 0; i < g.vehicles; ++i) {
        world.slots[i].delta = delta[i];
        world.slots[i].hold = hold[i];
        world.slots[i].waited = waited[i];
    }
}

// The state of one lane to that of one world, anywhere.
void store_lane(const ClosedLoopArguments& g, const World& world, int lane, long index) {
    const long first = index / WORLDS_PER_BLOCK * WORLDS_PER_BLOCK, place = index % WORLDS_PER_BLOCK;
    for (int i = 0; i < g.vehicles; ++i) {
        const Slot& slot = world.slots[i];
        const long k = (first * g.vehicles) + static_cast<long>(i) * WORLDS_PER_BLOCK + place;
        ClosedLoopState<Pointer>::for_each_of_vehicles<Slot>(
            [&](const auto&, auto field, auto in_slot) { (g.state.*field)[k] = (slot.*in_slot)[lane]; });
    }
    for (int k = 0; k < STREAM_WORDS; ++k) {
        g.state.random[first * 8 + k * WORLDS_PER_BLOCK + place] = world.random.s[k][lane];
    }
    g.state.cycle[index] = world.cycle[lane];
    g.state.ended[index] = 0;
}

// New starts for listed worlds, a row of lanes at a time.
template <Gap GAP>
bool run_start(const ClosedLoopArguments& g, ClosedLoopLanes& run) {
    World& world = run.world;
    const Ints wanted = lane_numbers() < g.listed_count;
    for (int l = 0; l < WIDTH; ++l) {
        const long index = g.listed[l < g.listed_count ? l : 0];
        for (int k = 0; k < STREAM_WORDS; ++k) {
            world.random.s[k][l] = g.state.random[index / WORLDS_PER_BLOCK * WORLDS_PER_BLOCK * 8 +
                                                  k * WORLDS_PER_BLOCK + index % WORLDS_PER_BLOCK];
        }
    }
    if (!start<GAP>(g.map, g.gap_network, g.vehicles, g.bodies, wanted, world, run.trial)) {
        return false;
    }
    if (g.desynchronise) {
        world.cycle = world.random.index(wanted, g.max_cycles);
    }
    for (int l = 0; l < g.listed_count; ++l) {
        store_lane(g, world, l, g.listed[l]);
    }
    for (int i = 0; i < g.vehicles; ++i) {
        Floats features[FEATURES];
        driving_features(world.slots[i], features);
        for (int l = 0; l < g.listed_count; ++l) {
            float* row = g.buffers.observation + (static_cast<long>(g.listed[l]) * g.vehicles + i) * FEATURES;
            store_rows<3>(features, row - l, 1, 1U << l);
        }
    }
    return true;
}

template <Gap GAP>
void run_step(const ClosedLoopArguments& g, ClosedLoopLanes& run) {
    const unsigned lanes = used(g);
    Ints& ended = row_at(g.state.ended, g, 0);
    const Ints ran = ~ended;
    load(g, run.world);
    load_columns(from_lane(g.buffers.action, g, g.vehicles), g.vehicles, g.vehicles, lanes, run.action);
    const Ints ends = step<GAP>(g, run);
    write_results(g, run, ran, ends);
    store(g, ran, run.world);
    write_observation(g, run.world, lanes & bits(ran));
    ended |= ends & run.world.exists;
}

// What a rollout asks of the worlds. Step and start are called by reference: as template arguments they would make
// three rollouts, one a kind of gap decision, and GCC then inlines less of what all share.
struct RolledOut {
    const ClosedLoopArguments& g;
    ClosedLoopLanes& run;
    Ints (&take_step)(const ClosedLoopArguments&, ClosedLoopLanes&);
    bool (&start_again)(const MapRows&, const GapNetwork*, int count, Bodies, Ints wanted, World&, World& trial);

    int vehicles() const { return g.vehicles; }
    void observe(int i, Floats* features) const { driving_features(run.world.slots[i], features); }
    void observe_last(int i, Floats* features) const { final_features(run, i, features); }
    Floats* action() { return run.action; }
    const Floats* paid() const { return run.step_reward; }
    Ints step() { return take_step(g, run) & run.world.exists; }
    Ints left(int i) const { return run.world.slots[i].left; }
    Ints blamed(int i) const { return run.world.slots[i].blamed; }
    bool restart(Ints ended) {
        return start_again(g.map, g.gap_network, g.vehicles, g.bodies, ended, run.world, run.trial);
    }
};

bool run_rollout(const ClosedLoopArguments& g, RolledOut worlds) {
    World& world = worlds.run.world;
    Random noise;
    for (int k = 0; k < STREAM_WORDS; ++k) {
        noise.s[k] = row_at(g.state.random, g, STREAM_WORDS + k);
    }
    if (!roll_out(*g.rollout, g.steps, g.first_world + g.first_lane, used(g), noise, worlds)) {
        return false;
    }
    store(g, all_ints(-1), world);
    for (int k = 0; k < STREAM_WORDS; ++k) {
        row_at(g.state.random, g, STREAM_WORDS + k) = noise.s[k];
    }
    write_observation(g, world, used(g));
    return true;
}

template <Gap GAP>
bool run_task(const ClosedLoopArguments& g, ClosedLoopLanes& run) {
    switch (g.task) {
    case Task::start:
        return run_start<GAP>(g, run);
    case Task::step:
        run_step<GAP>(g, run);
        return true;
    case Task::rollout:
        load(g, run.world);
        look<GAP>(g, run.world);
        return run_rollout(g, {g, run, step<GAP>, start<GAP>});
    default:
        load(g, run.world);
        look<GAP>(g, run.world);
        write_observation(g, run.world, used(g));
        return true;
    }
}

} // namespace

// Not filled with zeros: what is not used, as by worlds of few vehicles, then costs no memory.
Workspace* create_closed_loop() { return reinterpret_cast<Workspace*>(new ClosedLoopLanes); }
void destroy_closed_loop(Workspace* workspace) { delete reinterpret_cast<ClosedLoopLanes*>(workspace); }

bool run_closed_loop(const ClosedLoopArguments& g, Workspace& workspace) {
    ClosedLoopLanes& run = reinterpret_cast<ClosedLoopLanes&>(workspace);
    switch (g.gap) {
    case Gap::critical_gap:
        return run_task<Gap::critical_gap>(g, run);
    case Gap::sumo:
        return run_task<Gap::sumo>(g, run);
    default:
        return run_task<Gap::network>(g, run);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
