// A step of replay worlds: in each lane one vehicle of a recorded scene acts, and sees the others where they were.
#pragma once

#include "kernel/step/drive.hpp"
#include "kernel/worlds/companions.hpp"
#include "kernel/worlds/watch.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// Observes and decides, from the memories before; what the recorded vehicle decides was found out before.
inline void look(const ReplayArguments& g, ReplayLanes& run) {
    Slot& own = run.own;
    observe_vehicle(g.map, own);
    locate(g.map, g.bodies, own);
    if (g.map.stops != 0) {
        remember_stop(own);
    }
    run.collided = Ints{};
    run.open.count = 0;
    for_each_companion(g, run, [&](const Companions& them) {
        meet(g, them, run);
        touch(g, them, run);
    });
    answer_rest(g.gap_network, run.open, [&own](int l) { own.refused[l] = -1; });
    decide_vehicle(own, all_ints(-1));
    recall_decision(g, run);
}

// Begins an episode in the wanted lanes, with a given track where it is not negative; the memories are those of a
// start.
inline void begin(const ReplayArguments& g, Ints wanted, Ints given, ReplayLanes& run) {
    const Ints drawn = run.random.index(wanted, g.recorded.actor_count);
    const Floats where = run.random.uniform(wanted);
    for (unsigned lanes = bits(wanted); lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        run.track[l] = given[l] >= 0 ? given[l] : g.recorded.actors[drawn[l]];
    }
    load_track(g, run);
    Ints begin = run.first_recorded;
    if (g.desynchronise) {
        begin += as_ints(where * as_floats(run.end_step - 1 - run.first_recorded));
    }
    run.time = wanted ? begin : run.time;
    run.ended = wanted ? Ints{} : run.ended;
    Slot& own = run.own;
    take_recorded(g, wanted, run, own);
    own.acceleration = wanted ? recorded_acceleration(g, run) : own.acceleration;
    observe_line(own, own);
    own.delta = wanted ? under_way(own) : own.delta;
    run.expert_delta = wanted ? own.delta : run.expert_delta;
}

// What is now seen of new episodes; the decisions of lanes outside the mask stay.
inline void look_again(const ReplayArguments& g, Ints decided, ReplayLanes& run) {
    const Ints delta = run.own.delta, expert_delta = run.expert_delta, waited = run.own.waited;
    look(g, run);
    run.own.delta = decided ? run.own.delta : delta;
    run.expert_delta = decided ? run.expert_delta : expert_delta;
    run.own.waited = decided ? run.own.waited : waited;
}

// From actions to the new state, rewards and ends; returns the mask of episodes that end.
inline Ints step(const ReplayArguments& g, ReplayLanes& run) {
    Slot& own = run.own;
    own.acceleration = advance(g.acceleration_scale * run.action, 0.0F, all_ints(-1), own);
    run.left = own.position >= own.route_length;
    const Ints last = run.end_step - 1;
    run.time = run.time < last ? run.time + 1 : last;
    look(g, run);
    run.collided &= ~run.left;
    run.step_reward = reward(own, own.acceleration, run.collided);
    driving_features(own, run.last_features);
    if (any(run.left)) {
        Slot gone = own;
        observe_vehicle(g.map, gone);
        gone.delta = all_ints(-1);
        const Floats paid = reward(gone, gone.acceleration, Ints{});
        run.step_reward = run.left ? paid : run.step_reward;
        Floats features[FEATURES];
        driving_features(gone, features);
        for (int f = 0; f < FEATURES; ++f) {
            run.last_features[f] = run.left ? features[f] : run.last_features[f];
        }
    }
    return run.collided | run.left | (run.time >= last);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
