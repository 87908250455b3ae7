// A row of replay worlds: in each lane one vehicle of a recorded scene, which acts or is watched.
#pragma once

#include "kernel/worlds/open_gaps.hpp"
#include "kernel/worlds/results.hpp"
#include "kernel/worlds/world.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct ReplayLanes {
    Slot own; // the vehicle
    OpenGaps open;
    Random random;
    Ints track, time, ended, exists;
    Ints first_sample, first_step, end_step, first_recorded, first_window;
    Ints expert_delta; // what the recorded vehicle, the expert, decides at the same step
    Ints lead;         // which companion leads; -1: none
    Floats action, step_reward;
    Ints left, collided;
    Floats last_features[FEATURES];

    Ints sample() const { return first_sample + (time - first_step); }
};

inline void load_track(const ReplayArguments& g, ReplayLanes& run) {
    Floats row[TRACK_COLUMNS];
    load_rows<3>(g.recorded.tracks, run.track * TRACK_COLUMNS, row);
    Slot& own = run.own;
    own.route = as_ints(row[0]);
    own.half_length = row[1];
    own.half_width = row[2];
    own.max_speed = row[3];
    load_route(g.map, own);
    own.must_stop = row[8] != 0.0F;
    run.first_sample = as_ints(row[4]);
    run.first_step = as_ints(row[5]);
    run.end_step = as_ints(row[6]);
    run.first_recorded = as_ints(row[7]);
    run.first_window = as_ints(row[9]);
}

// The state in which the vehicle was recorded at the present step, where `wanted`.
inline void take_recorded(const ReplayArguments& g, Ints wanted, const ReplayLanes& run, Slot& slot) {
    Floats row[4];
    load_rows<1>(g.recorded.samples, run.sample() * SAMPLE_COLUMNS, row);
    const Ints waited = reinterpret_cast<Ints>(row[2]) >> 1; // remember_stop counts this step once more
    slot.position = wanted ? row[0] : slot.position;
    slot.speed = wanted ? row[1] : slot.speed;
    slot.waited = wanted ? (waited > 0 ? waited - 1 : waited) : slot.waited;
}

// What takes the recorded vehicle on to its next sample; at the last one, what took it there.
inline Floats recorded_acceleration(const ReplayArguments& g, const ReplayLanes& run) {
    const Ints sample = run.sample(), last = run.first_sample + (run.end_step - run.first_step) - 1;
    const Ints from = most(run.first_sample, sample < last ? sample : last - 1);
    const Ints to = from < last ? from + 1 : last;
    Floats before, after;
    for (int l = 0; l < WIDTH; ++l) {
        before[l] = g.recorded.samples[from[l] * SAMPLE_COLUMNS + 1];
        after[l] = g.recorded.samples[to[l] * SAMPLE_COLUMNS + 1];
    }
    return (after - before) / all(DT);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
