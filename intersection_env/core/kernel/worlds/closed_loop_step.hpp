// A step of closed-loop worlds: everybody acts, and whoever leaves is reinserted.
#pragma once

#include "kernel/step/drive.hpp"
#include "kernel/worlds/results.hpp"
#include "kernel/worlds/start.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct ClosedLoopLanes {
    World world, trial;
    Floats action[MAX_VEHICLES], step_reward[MAX_VEHICLES];
    Floats last_features[MAX_VEHICLES][FEATURES]; // of a vehicle that left
};

// A vehicle that has left, alone at the end of its route: its last features, and what it is paid.
inline void take_leave(const MapRows& map, ClosedLoopLanes& run, int i) {
    Slot gone = run.world.slots[i];
    observe_vehicle(map, gone);
    gone.delta = all_ints(-1);
    driving_features(gone, run.last_features[i]);
    run.step_reward[i] = reward(gone, gone.acceleration, Ints{});
}

// Where `counts`; the other one was not observed since it moved.
inline void follow_newcomers_lead(const Relation& r, Ints counts, const Slot& other, Slot& slot) {
    const Floats rear = other.position - other.half_length, front = other.position + other.half_length;
    const Floats ahead = other.position - r.offset - slot.position;
    const Ints there = ((slot.rear < r.split) & (rear < r.split)) | (r.merging & (front > r.other_end));
    follow(slot, counts & there & (ahead > 0.0F), ahead - (slot.half_length + other.half_length), other.speed,
           all_ints(-1));
}

inline void follow_newcomers_lead(const Link& r, Ints counts, const Slot& other, Slot& slot) {
    const Floats there = other.position - r.offset, ahead = there - slot.position;
    const Ints in_lane = (slot.rear < r.end) & (there - other.half_length < r.end) &
                         (other.position + other.half_length > r.other_begin);
    follow(slot, counts & in_lane & (ahead > 0.0F), ahead - (slot.half_length + other.half_length), other.speed,
           all_ints(-1));
}

inline void reinsert(const MapRows& map, int count, ClosedLoopLanes& run, int i) {
    World& world = run.world;
    Slot& slot = world.slots[i];
    const Ints left = slot.left;
    const Ints route = world.random.index(left, map.route_count);
    slot.route = left ? route : slot.route;
    draw_size(left, world.random, slot);
    load_route(map, slot);
    slot.position = left ? all(0.0F) : slot.position;
    slot.delta = left ? Ints{} : slot.delta;
    slot.hold = left ? all_ints(-1) : slot.hold;
    slot.waited = left ? Ints{} : slot.waited;
    observe_vehicle(map, slot);
    for (int j = 0; j < count; ++j) {
        const Slot& other = world.slots[j];
        const Ints counts = j == i ? Ints{} : (j < i ? all_ints(-1) : ~run.world.slots[j].left);
        if (map.links == nullptr) {
            follow_newcomers_lead(relation(map, slot, other), counts, other, slot);
        }
        for (int k = 0; k < map.link_count; ++k) {
            follow_newcomers_lead(link(map, slot, other, k), counts, other, slot);
        }
    }
    const Ints waits = slot.delta;
    slot.delta = all_ints(-1); // the stop line is far
    const Floats speed = drawn_speed(left, world.random, slot);
    slot.delta = waits;
    slot.speed = left ? speed : slot.speed;
}

// From actions to the new state, rewards and ends. Returns the mask of worlds that end.
template <Gap GAP>
inline Ints step(const ClosedLoopArguments& g, ClosedLoopLanes& run) {
    World& world = run.world;
    const int count = g.vehicles;
    Ints any_left{};
    for (int i = 0; i < count; ++i) {
        Slot& slot = world.slots[i];
        slot.acceleration = advance(g.acceleration_scale * run.action[i], -UNBOUNDED, all_ints(-1), slot);
        slot.left = (slot.position >= slot.route_length) | (slot.position < 0.0F);
        any_left |= slot.left;
    }
    if (any(any_left)) {
        for (int i = 0; i < count; ++i) {
            if (any(world.slots[i].left)) {
                take_leave(g.map, run, i);
                reinsert(g.map, count, run, i);
            }
        }
    }
    for (int i = 0; i < count; ++i) {
        observe_vehicle(g.map, world.slots[i]);
        locate(g.map, g.bodies, world.slots[i]);
    }
    decide<GAP>(g.map, g.gap_network, count, g.bodies, world);
    world.cycle += 1;
    Ints ends = world.collided | (world.cycle >= g.max_cycles);
    for (int i = 0; i < count; ++i) {
        const Slot& slot = world.slots[i];
        const Floats paid = reward(slot, slot.acceleration, slot.blamed);
        run.step_reward[i] = slot.left ? run.step_reward[i] : paid;
        ends |= slot.left & (trespass(slot) > TOLERANCE);
    }
    return ends;
}

// The features that a cut vehicle saw last.
inline void final_features(const ClosedLoopLanes& run, int i, Floats* features) {
    driving_features(run.world.slots[i], features);
    for (int f = 0; f < FEATURES; ++f) {
        features[f] = run.world.slots[i].left ? run.last_features[i][f] : features[f];
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
