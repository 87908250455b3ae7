// The recorded vehicles along their tracks: what they saw, and what they decided. It depends on the recording alone.
#pragma once

#include "kernel/worlds/companions.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// What a recorded vehicle sees at the present step; returns who decides to go. before: mask, had it decided to go.
inline Ints watch_step(const ReplayArguments& g, Ints before, ReplayLanes& run) {
    Slot& own = run.own;
    take_recorded(g, all_ints(-1), run, own);
    observe_vehicle(g.map, own);
    own.delta = before;
    run.lead = all_ints(-1);
    if (g.map.stops != 0) {
        remember_stop(own);
    }
    for_each_companion(g, run, [&](const Companions& them) { meet(g, them, run); });
    answer_rest(g.gap_network, run.open, [&own](int l) { own.refused[l] = -1; });
    return ~own.refused;
}

// Watches some tracks, one a lane, from step to step.
inline void watch(const ReplayArguments& g, ReplayLanes& run) {
    Slot& own = run.own;
    for (int l = 0; l < WIDTH; ++l) {
        run.track[l] = g.given[g.first_world + (l < g.worlds ? l : 0)];
    }
    load_track(g, run);
    run.open.count = 0;
    own.hold = all_ints(-1);
    const Ints are_watched = lane_numbers() < g.worlds;
    for (run.time = run.first_step; any(run.time < run.end_step); run.time += 1) {
        run.exists = are_watched & (run.time < run.end_step);
        run.time = run.time < run.end_step ? run.time : run.end_step - 1;
        const Ints from_waiting = watch_step(g, Ints{}, run);
        const Ints from_going = g.by_arrival ? watch_step(g, all_ints(-1), run) : from_waiting;
        const Ints goes = (from_waiting & GOES_FROM_WAITING) | ((from_going | under_way(own)) & GOES_FROM_GOING);
        const Ints sample = run.sample(), seen = goes | ((run.lead + 1) * LEADS);
        for (unsigned lanes = bits(run.exists); lanes != 0; lanes &= lanes - 1) {
            const int l = __builtin_ctz(lanes);
            g.seen[sample[l]] = seen[l];
        }
    }
}

// What was seen at the present step.
inline Ints seen(const ReplayArguments& g, const ReplayLanes& run) {
    const Ints sample = run.sample();
    Ints found;
    for (int l = 0; l < WIDTH; ++l) {
        found[l] = g.recorded.seen[sample[l]];
    }
    return found;
}

// What the recorded vehicle decides at the present step; run.expert_delta: what it did before.
inline void recall_decision(const ReplayArguments& g, ReplayLanes& run) {
    const Ints bit = run.expert_delta ? all_ints(GOES_FROM_GOING) : all_ints(GOES_FROM_WAITING);
    run.expert_delta = (seen(g, run) & bit) != 0;
}

// The recorded vehicle as it is at the present step, with all that it sees and what it has decided.
inline Slot recalled(const ReplayArguments& g, const ReplayLanes& run) {
    Slot expert = run.own;
    take_recorded(g, all_ints(-1), run, expert);
    observe_vehicle(g.map, expert);
    const Ints lead = seen(g, run) / LEADS - 1, leads = lead >= 0;
    Floats row[COMPANION_COLUMNS], sample[4];
    load_rows<4>(g.recorded.companions, (leads ? lead : Ints{}) * COMPANION_COLUMNS, row);
    const Ints at = leads ? as_ints(row[12]) + (run.time - as_ints(row[13])) : Ints{};
    load_rows<1>(g.recorded.samples, at * SAMPLE_COLUMNS, sample);
    const Floats ahead = sample[0] - row[2] - expert.position; // as in `follow`
    expert.lead_distance = leads ? ahead - (expert.half_length + row[10]) : expert.lead_distance;
    expert.lead_speed = leads ? sample[1] : expert.lead_speed;
    expert.delta = run.expert_delta;
    return expert;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
