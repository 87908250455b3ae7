// The recorded vehicles beside those that act: who of them leads, who has the right of way, and who is run into.
#pragma once

#include "kernel/lanes/pick.hpp"
#include "kernel/worlds/replay_lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// One a lane, of whichever world; see COMPANION_COLUMNS.
struct Companions {
    Floats row[COMPANION_COLUMNS], sample[8]; // of a sample, SAMPLE_COLUMNS count
    Ints which, at, world, present;           // which row and sample; world: the lane of the one that each is beside

    Ints memory() const { return reinterpret_cast<Ints>(sample[2]); }
    Ints held() const { return (memory() & 1) != 0; }
    Ints waited() const { return memory() >> 1; }
    Floats position() const { return sample[0]; }
    Floats speed() const { return sample[1]; }
    Floats front() const { return sample[0] + row[10]; }
    Floats rear() const { return sample[0] - row[10]; }
    Ints route() const { return as_ints(row[15]) & (MOST_ROUTES_OF_A_MAP - 1); }
    Ints rank() const { return as_ints(row[15]) / MOST_ROUTES_OF_A_MAP; }

    // What the one that each is beside has of something.
    template <class Lanes>
    Lanes beside(const Lanes& of_worlds) const {
        return pick(&of_worlds, 1, world);
    }
};

// A list of them, a full row of lanes but for the last one.
struct CompanionList {
    alignas(64) int row[2 * WIDTH], world[2 * WIDTH];
    int count;
};

inline Companions companions(const ReplayArguments& g, const ReplayLanes& run, const CompanionList& list) {
    Companions them;
    const Ints counts = lane_numbers() < list.count;
    them.which = counts ? lanes_at(list.row) : Ints{};
    them.world = counts ? lanes_at(list.world) : Ints{};
    load_rows<4>(g.recorded.companions, them.which * COMPANION_COLUMNS, them.row);
    const Ints time = them.beside(run.time), since = time - as_ints(them.row[13]);
    them.present = counts & (since >= 0) & (time < as_ints(them.row[14]));
    them.at = them.present ? as_ints(them.row[12]) + since : Ints{};
    load_rows<2>(g.recorded.samples, them.at * SAMPLE_COLUMNS, them.sample);
    return them;
}

// Calls visit(companions) until all were there that may matter at this step.
template <class Visit>
inline void for_each_companion(const ReplayArguments& g, const ReplayLanes& run, const Visit& visit) {
    const Ints window = run.first_window + (run.time - run.first_step) / WINDOW_STEPS;
    CompanionList list;
    list.count = 0;
    for (unsigned lanes = bits(run.exists); lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        const std::int32_t* ends = g.recorded.windows + window[l];
        const Ints world = all_ints(l);
        for (int place = ends[0]; place < ends[1];) {
            __builtin_memcpy(list.row + list.count, g.recorded.listed + place,
                             sizeof(Ints)); // a row, to the end or not
            __builtin_memcpy(list.world + list.count, &world, sizeof(Ints));
            const int left = ends[1] - place, room = WIDTH - list.count, taken = left < room ? left : room;
            place += taken;
            list.count += taken;
            if (list.count == WIDTH) {
                visit(companions(g, run, list));
                list.count = 0;
            }
        }
    }
    if (list.count > 0) {
        visit(companions(g, run, list));
    }
}

// Mask: of two that come to an all-way stop, the own one goes first.
inline Ints arrived_first(const Companions& them, const Slot& own) {
    const Ints cannot_stop = them.row[9] - them.front() < braking_distance(them.speed());
    const Ints theirs = turn(them.waited(), Ints{}, cannot_stop, cannot_stop), ours = them.beside(own.turn);
    const Ints theirs_held = them.held() ? them.rank() : all_ints(-1);
    const Ints yields = by_arrival(ours, theirs, theirs_held, them.beside(own.rank)) > 0;
    const Ints goes = by_arrival(theirs, ours, them.beside(own.hold), them.rank()) < 0;
    return them.row[6] > 0.0F ? yields : goes;
}

// The nearest of those that lead; of equally near ones the last.
inline void follow(const Companions& them, Floats own_position, Floats own_rear, ReplayLanes& run) {
    Slot& own = run.own;
    const Floats end = them.row[0], there = them.position() - them.row[2], ahead = there - own_position;
    const Ints in_lane = (own_rear < end) & (there - them.row[10] < end) & (them.front() > them.row[1]);
    const Floats gap = ahead - (them.beside(own.half_length) + them.row[10]);
    const Ints leads = them.present & (them.row[3] > 0.0F) & (ahead > 0.0F) & in_lane & (gap <= LEAD_RANGE);
    for (unsigned lanes = bits(leads); lanes != 0; lanes &= lanes - 1) {
        const int k = __builtin_ctz(lanes), l = them.world[k];
        if (gap[k] <= own.lead_distance[l]) {
            own.lead_distance[l] = gap[k];
            own.lead_speed[l] = them.sample[1][k];
            run.lead[l] = them.which[k];
        }
    }
}

inline void refuse(Ints refused, const Companions& them, Slot& own) {
    for (unsigned lanes = bits(refused); lanes != 0; lanes &= lanes - 1) {
        own.refused[them.world[__builtin_ctz(lanes)]] = -1;
    }
}

// What a vehicle that yields to a companion sees of it.
inline Encounter encounter(const ReplayArguments& g, const Companions& them, Floats own_rear, const Slot& own) {
    Encounter met{};
    met.distance_to_pga = them.row[4] - own_rear;
    met.speed = them.beside(own.speed);
    met.foe_distance_to_line = them.row[9] - them.front();
    met.foe_speed = them.speed();
    met.merging = them.row[6] > 1.5F;
    if (g.gap == Gap::sumo) {
        met.v_max = them.beside(own.environment[1]);
        met.distance_to_stop_line = them.beside(own.distance_to_stop_line);
        met.foe_distance_to_clear = them.row[5] - them.rear();
        for (int k = 0; k < WIDTH; ++k) {
            met.foe_v_max[k] = g.recorded.v_max[them.at[k]];
        }
    }
    return met;
}

// Who leads, and whether the vehicle, where it yields, accepts the gap. The network's answers may come later.
inline void meet(const ReplayArguments& g, const Companions& them, ReplayLanes& run) {
    Slot& own = run.own;
    const Floats own_position = them.beside(own.position), own_rear = them.beside(own.rear);
    follow(them, own_position, own_rear, run);

    const Floats kind = them.row[6];
    const Ints in_turn = magnitude(kind) == BY_ARRIVAL;
    Ints open = them.present & ((kind > 0.0F) | in_turn) & (own_rear < them.row[4]) & (them.position() < them.row[5]);
    if (g.recording) {
        refuse(open & (them.row[7] == 0.0F), them, own);
        return;
    }
    if (any(open & in_turn)) {
        refuse(open & in_turn & ~arrived_first(them, own), them, own);
        open &= ~in_turn;
    }
    open &= ~(them.held() & (them.rank() > them.beside(own.rank))); // it is held, and holds nobody up
    open &= ~them.beside(own.refused | settled(own));               // nothing would change
    if (any(open)) {
        const Encounter met = encounter(g, them, own_rear, own);
        if (g.gap == Gap::network) {
            Floats features[GAP_INPUTS];
            gap_features(met, features);
            ask(*g.gap_network, features, them.world, open, run.open, [&own](int l) { own.refused[l] = -1; });
        } else {
            refuse(open & ~accepts_gap(g.gap, nullptr, met), them, own);
        }
    }
}

// Whether a collision is the acting vehicle's fault, as the row of the companion has it: by the right of way of that
// row's conflict, or without one that counts by the order in the lane.
inline bool is_at_fault(const ReplayArguments& g, const Companions& them, int k, const Body& own, const Body& foe) {
    const Conflict* conflict = conflict_before_pga(*g.map.whole, own, foe);
    if (conflict == nullptr) {
        return them.row[3][k] > 0.0F;
    }
    const float kind = them.row[6][k];
    const bool yields = conflict->yielder == own.route;
    if (kind == 0.0F || (kind > 0.0F) != yields) {
        return false;
    }
    if (g.recording) {
        return them.row[7][k] == 0.0F;
    }
    return conflict->by_arrival && own.waited != foe.waited ? own.waited < foe.waited : yields;
}

// Mask: near enough to an own place for a body that reaches so far. place: as in a sample.
inline Ints is_near(const Grid& grid, Floats place, Floats own_x, Floats own_y, Floats far) {
    const Words lines = reinterpret_cast<Words>(place);
    const Floats x = own_x - grid.x - grid.step * as_floats(reinterpret_cast<Ints>(lines & 0xffffU));
    const Floats y = own_y - grid.y - grid.step * as_floats(reinterpret_cast<Ints>(lines >> 16));
    return x * x + y * y < far * far;
}

// Marks the worlds in which the acting vehicle collides by its own fault.
inline void touch(const ReplayArguments& g, const Companions& them, ReplayLanes& run) {
    const Slot& own = run.own;
    const Ints fault = as_ints(them.row[8]);
    const Ints looked_up = fault == static_cast<int>(Fault::looked_up);
    const Ints at_fault = looked_up | (fault == static_cast<int>(Fault::always)) |
                          ((fault == static_cast<int>(Fault::before_own_end)) & (them.beside(own.rear) < them.row[4])) |
                          ((fault == static_cast<int>(Fault::past_other_end)) & (them.rear() >= them.row[5]));
    const float margin = COLLISION_DISTANCE + 0.1F + g.recorded.grid.step; // rounding, headings beyond a route's end
    const Floats far = them.beside(own.reach) + reach(g.bodies, them.row[10], them.row[11]) + margin;
    const Ints near =
        is_near(g.recorded.grid, them.sample[3], them.beside(own.x), them.beside(own.y), far) |
        is_near(g.recorded.grid, them.sample[4], them.beside(own.braked_x), them.beside(own.braked_y), far);
    for (unsigned lanes = bits(them.present & at_fault & near); lanes != 0; lanes &= lanes - 1) {
        const int k = __builtin_ctz(lanes), l = them.world[k];
        const float speed = them.sample[1][k];
        const Body body{own.route[l], own.position[l], 2.0F * own.half_length[l], 2.0F * own.half_width[l],
                        own.waited[l]};
        const Body foe{them.route()[k], them.sample[0][k], 2.0F * them.row[10][k], 2.0F * them.row[11][k],
                       them.waited()[k]};
        if (collide(*g.map.whole, body, foe, own.braking_distance[l], speed * speed * (0.5F / BRAKING), g.bodies) &&
            (looked_up[k] == 0 || is_at_fault(g, them, k, body, foe))) {
            run.collided[l] = -1;
        }
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
