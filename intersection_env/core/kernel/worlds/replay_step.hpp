// A step of replay worlds: in each lane one vehicle of a recorded scene acts, and sees the others where they were.
#pragma once

#include "kernel/step/drive.hpp"
#include "kernel/worlds/results.hpp"
#include "kernel/worlds/world.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// Gap decisions of the acting vehicles that wait for the network, which takes them a full row of lanes at a time.
struct OpenGaps {
    alignas(64) float features[GAP_INPUTS][3 * WIDTH];
    int lane[3 * WIDTH];
    int count;
};

struct ReplayLanes {
    Slot acting, expert; // the vehicle that acts, and the recorded one at the same step
    OpenGaps open;
    Random random;
    Ints track, time, ended, exists;
    Ints first_sample, first_step, end_step, first_recorded, first_window;
    Ints listed_begin, listed_end; // the companions that may be present at this step
    Floats action, step_reward, expert_acceleration;
    Ints left, collided;
    Floats last_features[FEATURES];
};

inline void load_track(const ReplayArguments& g, ReplayLanes& run) {
    Floats row[TRACK_COLUMNS];
    load_rows<3>(g.recorded.tracks, run.track * TRACK_COLUMNS, row);
    for (Slot* slot : {&run.acting, &run.expert}) {
        slot->route = as_ints(row[0]);
        slot->half_length = row[1];
        slot->half_width = row[2];
        slot->max_speed = row[3];
        load_route(g.map, *slot);
        slot->must_stop = row[10] != 0.0F;
    }
    run.first_sample = as_ints(row[4]);
    run.first_step = as_ints(row[5]);
    run.end_step = as_ints(row[6]);
    run.first_recorded = as_ints(row[7]);
    run.first_window = as_ints(row[11]);
}

// The recorded vehicle at the present step.
inline void load_expert(const ReplayArguments& g, ReplayLanes& run) {
    const Ints sample = run.first_sample + (run.time - run.first_step);
    Floats row[SAMPLE_COLUMNS];
    load_rows<1>(g.recorded.samples, sample * SAMPLE_COLUMNS, row);
    run.expert.position = row[0];
    run.expert.speed = row[1];
    const Ints waited = as_ints(row[2]) >> 1; // remember_stop counts this step once more
    run.expert.waited = waited > 0 ? waited - 1 : waited;
    for (int l = 0; l < WIDTH; ++l) {
        run.expert_acceleration[l] = g.recorded.acceleration[sample[l]];
    }
}

// A recorded vehicle beside the acting one; see COMPANION_COLUMNS.
struct Companion {
    Floats row[COMPANION_COLUMNS], sample[SAMPLE_COLUMNS];
    Ints present, row_offset;

    Ints held() const { return (as_ints(sample[2]) & 1) != 0; }
    Ints waited() const { return as_ints(sample[2]) >> 1; }
    Floats position() const { return sample[0]; }
    Floats speed() const { return sample[1]; }
    Floats front() const { return sample[0] + row[10]; }
    Floats rear() const { return sample[0] - row[10]; }
};

inline Companion companion(const ReplayArguments& g, const ReplayLanes& run, int index) {
    Companion one;
    const Ints counts = run.listed_begin + index < run.listed_end;
    const Ints place = counts ? run.listed_begin + index : Ints{};
    for (int l = 0; l < WIDTH; ++l) {
        one.row_offset[l] = g.recorded.listed[place[l]] * COMPANION_COLUMNS;
    }
    load_rows<4>(g.recorded.companions, one.row_offset, one.row);
    const Ints since = run.time - as_ints(one.row[13]);
    one.present = counts & (since >= 0) & (run.time < as_ints(one.row[14]));
    const Ints sample = one.present ? as_ints(one.row[12]) + since : Ints{};
    load_rows<2>(g.recorded.samples, sample * SAMPLE_COLUMNS, one.sample);
    return one;
}

// Mask: of two that come to an all-way stop, the own one goes first.
inline Ints arrived_first(const Companion& other, const Slot& own) {
    const Ints cannot_stop = other.row[9] - other.front() < braking_distance(other.speed());
    const Ints theirs = turn(other.waited(), Ints{}, cannot_stop, cannot_stop), route = as_ints(other.row[15]);
    const Ints yields = by_arrival(own.turn, theirs, other.held() ? route : all_ints(-1), own.route) > 0;
    const Ints goes = by_arrival(theirs, own.turn, own.hold, route) < 0;
    return other.row[6] > 0.0F ? yields : goes;
}

// The network's answers to the first that wait, at most a row of them.
inline void answer(const GapNetwork& network, OpenGaps& open, Slot& own) {
    const int count = open.count < WIDTH ? open.count : WIDTH;
    Floats input[GAP_INPUTS];
    for (int f = 0; f < GAP_INPUTS; ++f) {
        input[f] = lanes_at(open.features[f]);
    }
    unsigned refused = bits(~(evaluate(network, input, LeakyRelu{}) > 0.0F)) & ((1U << count) - 1);
    for (; refused != 0; refused &= refused - 1) {
        own.refused[open.lane[__builtin_ctz(refused)]] = -1;
    }
    open.count -= count;
    for (int k = 0; k < open.count; ++k) {
        open.lane[k] = open.lane[k + WIDTH];
        for (int f = 0; f < GAP_INPUTS; ++f) {
            open.features[f][k] = open.features[f][k + WIDTH];
        }
    }
}

// Puts the lanes of this encounter on the list.
inline void ask(const GapNetwork& network, const Encounter& met, Ints wanted, OpenGaps& open, Slot& own) {
    Floats features[GAP_INPUTS];
    gap_features(met, features);
    const unsigned lanes = bits(wanted);
    compress(lane_numbers(), lanes, open.lane + open.count);
    for (int f = 0; f < GAP_INPUTS; ++f) {
        compress(reinterpret_cast<Ints>(features[f]), lanes, reinterpret_cast<int*>(open.features[f] + open.count));
    }
    open.count += __builtin_popcount(lanes);
    if (open.count >= WIDTH) {
        answer(network, open, own);
    }
}

// Who leads, and whether the own vehicle, where it yields, accepts the gap. The network's answers come later, by
// `open`.
inline void meet(const ReplayArguments& g, const Companion& other, OpenGaps& waiting, Slot& own) {
    const Floats end = other.row[0], there = other.position() - other.row[2], ahead = there - own.position;
    const Ints in_lane = (own.rear < end) & (there - other.row[10] < end) & (other.front() > other.row[1]);
    const Ints leads = other.present & (other.row[3] > 0.0F) & (ahead > 0.0F) & in_lane;
    follow(own, leads, ahead - (own.half_length + other.row[10]), other.speed(), all_ints(-1));

    const Floats kind = other.row[6];
    const Ints in_turn = magnitude(kind) == BY_ARRIVAL;
    Ints open =
        other.present & ((kind > 0.0F) | in_turn) & (own.rear < other.row[4]) & (other.position() < other.row[5]);
    if (g.recording) {
        own.refused |= open & (other.row[7] == 0.0F);
        return;
    }
    if (any(open & in_turn)) {
        own.refused |= open & in_turn & ~arrived_first(other, own);
        open &= ~in_turn;
    }
    open &= ~(other.held() & (as_ints(other.row[15]) > own.route)); // it is held, and holds nobody up
    if (any(open)) {
        const Encounter met = {other.row[4] - own.rear,
                               own.speed,
                               own.v_max(),
                               own.distance_to_stop_line,
                               other.row[9] - other.front(),
                               other.speed(),
                               other.sample[3],
                               other.row[5] - other.rear(),
                               kind > 1.5F};
        if (g.gap == Gap::network) {
            ask(*g.gap_network, met, open, waiting, own);
        } else {
            own.refused |= open & ~accepts_gap(g.gap, nullptr, met);
        }
    }
}

// Whether a collision is the acting vehicle's fault, as the row of the companion has it: by the right of way of that
// row's conflict, or without one that counts by the order in the lane.
inline bool is_at_fault(const ReplayArguments& g, const Companion& other, int lane, const Body& own, const Body& foe) {
    const Conflict* conflict = conflict_before_pga(*g.map.whole, own, foe);
    if (conflict == nullptr) {
        return other.row[3][lane] > 0.0F;
    }
    const float kind = other.row[6][lane];
    const bool yields = conflict->yielder == own.route;
    if (kind == 0.0F || (kind > 0.0F) != yields) {
        return false;
    }
    if (g.recording) {
        return other.row[7][lane] == 0.0F;
    }
    return conflict->by_arrival && own.waited != foe.waited ? own.waited < foe.waited : yields;
}

// Marks the lanes where the acting vehicle collides by its own fault.
inline void touch(const ReplayArguments& g, const Companion& other, ReplayLanes& run) {
    const Slot& own = run.acting;
    const Ints fault = as_ints(other.row[8]);
    const Ints looked_up = fault == static_cast<int>(Fault::looked_up);
    const Ints at_fault = looked_up | (fault == static_cast<int>(Fault::always)) |
                          ((fault == static_cast<int>(Fault::before_own_end)) & (own.rear < other.row[4])) |
                          ((fault == static_cast<int>(Fault::past_other_end)) & (other.rear() >= other.row[5]));
    constexpr float MARGIN = COLLISION_DISTANCE + 0.1F; // rounding, and headings beyond the end of a route
    const Floats far = own.reach + reach(g.bodies, other.row[10], other.row[11]) + MARGIN;
    const Floats x = own.x - other.sample[4], y = own.y - other.sample[5];
    const Floats p = own.braked_x - other.sample[6], q = own.braked_y - other.sample[7];
    const Ints near =
        other.present & at_fault & ((x * x + y * y < far * far) | (p * p + q * q < far * far)) & run.exists;
    for (unsigned lanes = bits(near); lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        const float speed = other.sample[1][l];
        const Body body{own.route[l], own.position[l], 2.0F * own.half_length[l], 2.0F * own.half_width[l],
                        own.waited[l]};
        const Body foe{static_cast<int>(other.row[15][l]), other.sample[0][l], 2.0F * other.row[10][l],
                       2.0F * other.row[11][l], other.waited()[l]};
        if (collide(*g.map.whole, body, foe, own.braking_distance[l], speed * speed * (0.5F / BRAKING), g.bodies) &&
            (looked_up[l] == 0 || is_at_fault(g, other, l, body, foe))) {
            run.collided[l] = -1;
        }
    }
}

// Finds the companions that may be present at this step; returns how many at the most.
inline int find_companions(const ReplayArguments& g, ReplayLanes& run) {
    const Ints window = run.first_window + (run.time - run.first_step) / WINDOW_STEPS;
    int most = 0;
    for (int l = 0; l < WIDTH; ++l) {
        const std::int32_t* ends = g.recorded.windows + 2L * window[l];
        run.listed_begin[l] = ends[0];
        run.listed_end[l] = ends[1];
        most = ends[1] - ends[0] > most ? ends[1] - ends[0] : most;
    }
    return most;
}

// What the recorded vehicle sees and says at this step was found out before; see `watch`. road: it looks at that too,
// which no decision needs.
inline void recall(const ReplayArguments& g, bool road, ReplayLanes& run) {
    Slot& expert = run.expert;
    if (road) {
        observe_vehicle(g.map, expert);
    } else {
        observe_line(expert, expert);
    }
    Floats row[SEEN_COLUMNS];
    load_rows<1>(g.recorded.seen, (run.first_sample + (run.time - run.first_step)) * SEEN_COLUMNS, row);
    expert.lead_distance = row[0];
    expert.lead_speed = row[1];
    expert.refused = (expert.delta ? row[3] : row[2]) != 0.0F;
}

// Observes and decides for both, from the memories before. road: the recorded vehicle looks at its road too.
inline void look(const ReplayArguments& g, bool road, ReplayLanes& run) {
    Slot &acting = run.acting, &expert = run.expert;
    observe_vehicle(g.map, acting);
    recall(g, road, run);
    locate(g.map, g.bodies, acting);
    if (g.map.stops != 0) {
        remember_stop(acting);
    }
    run.collided = Ints{};
    run.open.count = 0;
    const int most = find_companions(g, run);
    for (int c = 0; c < most; ++c) {
        const Companion other = companion(g, run, c);
        if (any(other.present)) {
            meet(g, other, run.open, acting);
            touch(g, other, run);
        }
    }
    if (run.open.count != 0) {
        answer(*g.gap_network, run.open, acting);
    }
    decide_vehicle(acting, all_ints(-1));
    decide_vehicle(expert, all_ints(-1));
}

// Watches the recorded vehicles of some tracks, one a lane, from step to step: what each sees, and whether it is
// refused, had it decided to wait before, and had it decided to go.
inline void watch(const ReplayArguments& g, ReplayLanes& run) {
    Slot& expert = run.expert;
    for (int l = 0; l < WIDTH; ++l) {
        run.track[l] = g.given[g.first_world + (l < g.worlds ? l : 0)];
    }
    load_track(g, run);
    run.open.count = 0;
    for (run.time = run.first_step; any(run.time < run.end_step); run.time += 1) {
        const Ints inside = run.time < run.end_step;
        run.time = inside ? run.time : run.end_step - 1;
        const int most = find_companions(g, run);
        Ints refused[2];
        for (int before = 0; before < 2; ++before) {
            load_expert(g, run);
            observe_vehicle(g.map, expert);
            expert.delta = all_ints(-before);
            if (g.map.stops != 0) {
                remember_stop(expert);
            }
            for (int c = 0; c < most; ++c) {
                const Companion other = companion(g, run, c);
                if (any(other.present)) {
                    meet(g, other, run.open, expert);
                }
            }
            if (run.open.count != 0) {
                answer(*g.gap_network, run.open, expert);
            }
            refused[before] = expert.refused;
        }
        const Ints sample = run.first_sample + (run.time - run.first_step);
        for (int l = 0; l < g.worlds; ++l) {
            float* seen = g.seen + static_cast<long>(sample[l]) * SEEN_COLUMNS;
            seen[0] = expert.lead_distance[l];
            seen[1] = expert.lead_speed[l];
            seen[2] = refused[0][l] != 0 ? 1.0F : 0.0F;
            seen[3] = refused[1][l] != 0 ? 1.0F : 0.0F;
        }
    }
}

inline void remember(const ReplayArguments& g, Slot& slot) {
    observe_vehicle(g.map, slot);
    slot.delta = under_way(slot);
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
    load_expert(g, run);
    const Slot before = run.acting, expert_before = run.expert;
    run.acting.position = wanted ? run.expert.position : before.position;
    run.acting.speed = wanted ? run.expert.speed : before.speed;
    run.acting.acceleration = wanted ? run.expert_acceleration : before.acceleration;
    run.acting.waited = wanted ? run.expert.waited : before.waited;
    remember(g, run.acting);
    remember(g, run.expert);
    run.acting.delta = wanted ? run.acting.delta : before.delta;
    run.expert.delta = wanted ? run.expert.delta : expert_before.delta;
}

// What is now seen of new episodes; the decisions of lanes outside the mask stay.
inline void look_again(const ReplayArguments& g, Ints decided, bool road, ReplayLanes& run) {
    const Ints delta = run.acting.delta, expert_delta = run.expert.delta, waited = run.acting.waited;
    look(g, road, run);
    run.acting.delta = decided ? run.acting.delta : delta;
    run.expert.delta = decided ? run.expert.delta : expert_delta;
    run.acting.waited = decided ? run.acting.waited : waited;
}

// From actions to the new state, rewards and ends; returns the mask of episodes that end.
inline Ints step(const ReplayArguments& g, bool road, ReplayLanes& run) {
    Slot& acting = run.acting;
    acting.acceleration = advance(g.acceleration_scale * run.action, 0.0F, all_ints(-1), acting);
    run.left = acting.position >= acting.route_length;
    const Ints last = run.end_step - 1;
    run.time = run.time < last ? run.time + 1 : last;
    load_expert(g, run);
    look(g, road, run);
    run.collided &= ~run.left;
    run.step_reward = reward(acting, acting.acceleration, run.collided);
    driving_features(acting, run.last_features);
    if (any(run.left)) {
        Slot gone = acting;
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
