// A block of closed-loop worlds: each lane is a world, each vehicle in it has a route of its own.
#pragma once

#include "kernel/lanes/random.hpp"
#include "kernel/step/decide.hpp"
#include "kernel/step/reward.hpp"
#include "kernel/step/stops.hpp"
#include "kernel/worlds/open_gaps.hpp"
#include "model/circles.hpp"
#include "model/contact.hpp"
#include "tables/map_tables.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct Slot : VehicleLanes {
    Floats half_length, half_width, max_speed, acceleration;
    Ints route;

    Floats stop_line, route_length, first_conflict, last_row; // of the route
    Ints first_row, stop_lane, rank, overlaps, pair_row, must_stop;
    Ints turn; // at an all-way stop

    Floats x, y, braked_x, braked_y, reach; // reach: the body goes no further from the centre [m]
    Ints left, blamed;                      // masks; left: reinserted in this step

    Ints first() const { return first_row; }
    Floats last() const { return last_row; }
    Floats top_speed() const { return max_speed; }
};

struct World {
    Slot slots[MAX_VEHICLES];
    Random random;
    Ints cycle, collided;
    Ints exists; // mask: the lanes that stand for a world
    OpenGaps open;
};

inline void load_route(const MapRows& map, Slot& slot) {
    Floats row[ROUTE_COLUMNS];
    load_rows<2>(map.routes, slot.route * ROUTE_COLUMNS, row);
    slot.stop_line = row[0];
    slot.route_length = row[1];
    slot.first_conflict = row[2];
    slot.first_row = as_ints(row[3]);
    slot.last_row = row[4];
    slot.stop_lane = as_ints(row[5]) & (MOST_ROUTES_OF_A_MAP - 1);
    slot.rank = as_ints(row[5]) / MOST_ROUTES_OF_A_MAP;
    slot.overlaps = as_ints(row[6]) | (as_ints(row[7]) << 16);
    slot.pair_row =
        slot.route * (map.route_count * (map.links == nullptr ? PAIR_COLUMNS : map.link_count * LINK_COLUMNS));
    slot.must_stop = ((all_ints(static_cast<int>(map.stops)) >> slot.route) & 1) != 0;
}

inline void observe_vehicle(const MapRows& map, Slot& slot) {
    observe_road(map.observed, map.inverse_spacing, slot, true, slot);
    forget_lead(slot);
    slot.refused = slot.kept = slot.blamed = Ints{};
}

// Beyond its end a route goes straight on.
inline void locate(const MapRows& map, const Slot& slot, Floats position, Floats& x, Floats& y) {
    const Floats grid = most(position * map.inverse_spacing, all(0.0F));
    const Ints row = as_ints(least(grid, slot.last_row - 1.0F));
    Floats point[4];
    load_rows<1>(map.points, (slot.first_row + row) * 4, point);
    const Floats f = grid - as_floats(row);
    x = point[0] + f * point[2];
    y = point[1] + f * point[3];
}

// How far from the centre a body goes at most [m].
inline Floats reach(Bodies bodies, Floats half_length, Floats half_width) {
    return bodies == Bodies::rectangles ? half_length + half_width
                                        : half_length * (2.0F * CIRCLE_OFFSET) + half_width * (2.0F * CIRCLE_RADIUS);
}

inline void locate(const MapRows& map, Bodies bodies, Slot& slot) {
    slot.reach = reach(bodies, slot.half_length, slot.half_width);
    locate(map, slot, slot.position, slot.x, slot.y);
    locate(map, slot, slot.position + slot.braking_distance, slot.braked_x, slot.braked_y);
}

// What two routes are to each other; see PAIR_COLUMNS.
struct Relation {
    Floats own_end, other_end, kind; // kind: 1 crossing, 2 merging, negative where the other yields; 0 no conflict
    Floats split, offset;            // of a shared lane: before a split; after a merge
    Ints merging;
};

inline Relation relation(const MapRows& map, const Slot& own, const Slot& other) {
    Floats row[PAIR_COLUMNS];
    load_rows<1>(map.pairs, own.pair_row + other.route * PAIR_COLUMNS, row);
    const Ints entry = row[3] == SHARED_ENTRY, merging = magnitude(row[3]) == 2.0F;
    return {row[0], row[1], entry ? all(0.0F) : row[3], entry ? row[2] : all(-FAR), merging ? row[2] : all(0.0F),
            merging};
}

// A conflict, a lane that they share, or both; see LINK_COLUMNS.
struct Link {
    Floats own_end, other_end, kind, line;
    Floats other_begin, own_begin, end, offset;
    Ints by_arrival;
};

inline Link link(const MapRows& map, const Slot& own, const Slot& other, int k) {
    Floats row[LINK_COLUMNS];
    load_rows<3>(map.links, own.pair_row + (other.route * map.link_count + k) * LINK_COLUMNS, row);
    return {row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8] != 0.0F};
}

// Told of a yielder whose gap the network refuses: its lane, and its slot in the upper byte.
struct RefusedIn {
    World& world;

    void operator()(int who) const { world.slots[who >> 8].refused[who & 255] = -1; }
};

// The gap decision of two vehicles of which a sees `seen`. kind, own_end, other_end: as in Link; line: of the one that
// goes first. open: where it counts.
template <Gap GAP>
inline void judge(const GapNetwork* network, World& world, int i, int j, Ints open, Floats kind, Floats own_end,
                  Floats other_end, Floats line, Seen& seen) {
    Slot &a = world.slots[i], &b = world.slots[j];
    const Ints a_yields = kind > 0.0F;
    const Floats pga = a_yields ? own_end : other_end, foe_end = a_yields ? other_end : own_end;
    if constexpr (GAP == Gap::network) {
        const Floats features[GAP_INPUTS] = {pga - (a_yields ? a.rear : b.rear), a_yields ? a.speed : b.speed,
                                             line - (a_yields ? b.front : a.front), a_yields ? b.speed : a.speed};
        const Ints who = lane_numbers() | (a_yields ? all_ints(i << 8) : all_ints(j << 8));
        ask(*network, features, who, open, world.open, RefusedIn{world});
        return;
    }
    const Encounter met = {pga - (a_yields ? a.rear : b.rear),
                           a_yields ? a.speed : b.speed,
                           a_yields ? a.v_max() : b.v_max(),
                           a_yields ? a.distance_to_stop_line : b.distance_to_stop_line,
                           line - (a_yields ? b.front : a.front),
                           a_yields ? b.speed : a.speed,
                           a_yields ? b.v_max() : a.v_max(),
                           foe_end - (a_yields ? b.rear : a.rear),
                           magnitude(kind) == 2.0F};
    const Ints refused = open & ~accepts_gap(GAP, nullptr, met);
    seen.refused |= refused & a_yields;
    b.refused |= refused & ~a_yields;
}

// Mask: no gap decision changes what it decides. refused: where something refuses it already.
inline Ints is_decided(const Slot& slot, Ints refused) { return settled(slot) | refused | slot.refused; }

// Who leads whom, and whether the one that yields to the other accepts the gap. seen: what a has seen so far.
template <Gap GAP>
inline void meet(const MapRows& map, const GapNetwork* network, World& world, int i, int j, Seen& seen) {
    Slot &a = world.slots[i], &b = world.slots[j];
    const Relation r = relation(map, a, b);
    const Floats ahead = b.position - r.offset - a.position;
    const Ints entry = (a.rear < r.split) & (b.rear < r.split), same_lane = a.stop_lane == b.stop_lane;
    const Floats gap = magnitude(ahead) - (a.half_length + b.half_length);
    follow(seen, (ahead > 0.0F) & (entry | (r.merging & (b.front > r.other_end))), gap, b.speed,
           same_lane ? b.hold : all_ints(-1));
    follow(b, (ahead < 0.0F) & (entry | (r.merging & (a.front > r.own_end))), gap, a.speed,
           same_lane ? a.hold : all_ints(-1));

    const Ints a_yields = r.kind > 0.0F;
    const Floats rear = a_yields ? a.rear : b.rear, pga = a_yields ? r.own_end : r.other_end;
    const Floats foe_position = a_yields ? b.position : a.position, foe_end = a_yields ? r.other_end : r.own_end;
    const Ints foe_hold = a_yields ? b.hold : a.hold, rank = a_yields ? a.rank : b.rank;
    const Ints active = (r.kind != 0.0F) & (rear < pga) & (foe_position < foe_end);
    b.kept |= active & a_yields & settled(a) & ~b.delta;
    seen.kept |= active & ~a_yields & settled(b) & ~a.delta;
    const Ints decided = a_yields ? is_decided(a, seen.refused) : is_decided(b, Ints{});
    const Ints open = active & (foe_hold <= rank) & ~decided;
    if (any(open)) {
        const Floats line = a_yields ? b.stop_line : a.stop_line;
        judge<GAP>(network, world, i, j, open, r.kind, r.own_end, r.other_end, line, seen);
    }
}

// Of two that came to an all-way stop, the later one waits. first: mask, where a is the one that yields on a tie.
inline void meet_by_arrival(const Link& r, Ints first, Slot& a, Slot& b, Seen& seen) {
    const Ints way = first ? by_arrival(a.turn, b.turn, b.hold, a.rank) : -by_arrival(b.turn, a.turn, a.hold, b.rank);
    const Ints a_waits = (way < 0) & (a.rear < r.own_end) & (b.position < r.other_end);
    const Ints b_waits = (way > 0) & (b.rear < r.other_end) & (a.position < r.own_end);
    seen.refused |= r.by_arrival & a_waits;
    b.refused |= r.by_arrival & b_waits;
}

// The same where routes may share lanes anywhere, conflict twice, or come to an all-way stop.
template <Gap GAP>
inline void meet_along_lanes(const MapRows& map, const GapNetwork* network, World& world, int i, int j, Seen& seen) {
    Slot &a = world.slots[i], &b = world.slots[j];
    const Ints same_lane = a.stop_lane == b.stop_lane;
    for (int k = 0; k < map.link_count; ++k) {
        const Link r = link(map, a, b, k);
        const Floats there = b.position - r.offset,
                     gap = magnitude(there - a.position) - (a.half_length + b.half_length);
        const Ints in_lane = (a.rear < r.end) & (there - b.half_length < r.end);
        follow(seen, in_lane & (there > a.position) & (b.front > r.other_begin), gap, b.speed,
               same_lane ? b.hold : all_ints(-1));
        follow(b, in_lane & (there < a.position) & (a.front > r.own_begin), gap, a.speed,
               same_lane ? a.hold : all_ints(-1));
        const Ints a_yields = r.kind > 0.0F, exists = r.kind != 0.0F;
        meet_by_arrival(r, a_yields, a, b, seen);
        const Ints active = exists & ~r.by_arrival &
                            (a_yields ? (a.rear < r.own_end) & (b.position < r.other_end)
                                      : (b.rear < r.other_end) & (a.position < r.own_end));
        b.kept |= active & a_yields & settled(a) & ~b.delta;
        seen.kept |= active & ~a_yields & settled(b) & ~a.delta;
        const Ints decided = a_yields ? is_decided(a, seen.refused) : is_decided(b, Ints{});
        const Ints open = active & ((a_yields ? b.hold : a.hold) <= (a_yields ? a.rank : b.rank)) & ~decided;
        if (any(open)) {
            judge<GAP>(network, world, i, j, open, r.kind, r.own_end, r.other_end, r.line, seen);
        }
    }
}

// Marks who is to blame where two vehicles collide. Bodies that are far apart are not looked at closely.
inline void touch(const MapRows& map, Bodies bodies, World& world, int i, int j) {
    Slot &a = world.slots[i], &b = world.slots[j];
    constexpr float MARGIN = COLLISION_DISTANCE + 0.1F; // rounding, and headings beyond the end of a route
    const Floats far = a.reach + b.reach + MARGIN;
    const Floats x = a.x - b.x, y = a.y - b.y, p = a.braked_x - b.braked_x, q = a.braked_y - b.braked_y;
    const Ints near = ((x * x + y * y < far * far) | (p * p + q * q < far * far)) &
                      (((a.overlaps >> b.route) & 1) != 0) & world.exists;
    for (unsigned lanes = bits(near); lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        const Body body_a{a.route[l], a.position[l], 2.0F * a.half_length[l], 2.0F * a.half_width[l], a.waited[l]};
        const Body body_b{b.route[l], b.position[l], 2.0F * b.half_length[l], 2.0F * b.half_width[l], b.waited[l]};
        if (collide(*map.whole, body_a, body_b, a.braking_distance[l], b.braking_distance[l], bodies)) {
            world.collided[l] = -1;
            if ((a.left[l] | b.left[l]) != 0) {
                continue; // a newcomer without room is nobody's fault
            }
            const Blame blame = to_blame(*map.whole, body_a, body_b);
            a.blamed[l] |= blame.a ? -1 : 0;
            b.blamed[l] |= blame.b ? -1 : 0;
        }
    }
}

// Where the map has stops. Needs observe_vehicle.
inline void remember_stop(Slot& slot) {
    remember_stop(slot.must_stop, all_ints(-1), slot);
    slot.turn = turn(slot.waited, Ints{}, settled(slot), slot.distance_to_stop_line < slot.braking_distance);
}

// Each vehicle of a world with each.
template <Gap GAP, bool PLAIN>
inline void meet_all(const MapRows& map, const GapNetwork* network, int count, Bodies bodies, World& world) {
    for (int i = 0; i < count; ++i) {
        Slot& slot = world.slots[i];
        Seen seen = slot;
        for (int j = i + 1; j < count; ++j) {
            if constexpr (PLAIN) {
                meet<GAP>(map, network, world, i, j, seen);
            } else {
                meet_along_lanes<GAP>(map, network, world, i, j, seen);
            }
            if (bodies != Bodies::unseen) {
                touch(map, bodies, world, i, j);
            }
        }
        const Ints refused = slot.refused | seen.refused; // the network may have answered in between
        static_cast<Seen&>(slot) = seen;
        slot.refused = refused;
    }
}

template <Gap GAP>
[[gnu::noinline]] void meet_all_along_lanes(const MapRows& map, const GapNetwork* network, int count, Bodies bodies,
                                            World& world) {
    meet_all<GAP, false>(map, network, count, bodies, world);
}

// Needs observe_vehicle of each, and the memories before the decision; unless bodies are unseen, needs locate, and
// looks for collisions.
template <Gap GAP>
inline void decide(const MapRows& map, const GapNetwork* network, int count, Bodies bodies, World& world) {
    world.open.count = 0;
    world.collided = Ints{};
    for (int i = 0; i < count && map.stops != 0; ++i) {
        remember_stop(world.slots[i]);
    }
    if (map.links == nullptr) {
        meet_all<GAP, true>(map, network, count, bodies, world);
    } else {
        meet_all_along_lanes<GAP>(map, network, count, bodies, world);
    }
    answer_rest(network, world.open, RefusedIn{world});
    for (int i = 0; i < count; ++i) {
        decide_vehicle(world.slots[i], world.slots[i].rank);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
