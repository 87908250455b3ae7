// New starts: random traffic that violates no constraint, found by trials, a row of lanes at a time.
#pragma once

#include "kernel/worlds/world.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr int MOST_ROUNDS = 5000;      // rows of trials for one row of starts
constexpr int PLACEMENTS = 8;          // draws of a route and a position for one vehicle
constexpr int SPEED_ROUNDS = 2;        // decisions depend on speeds, speeds on decisions
constexpr float STANDING_APART = 2.0F; // [m], ours
constexpr float TOLERANCE = 1.0e-3F;   // a penalty below it violates nothing
constexpr float CAR_SHARE = 0.9F;      // ours, as are the sizes: those of the stand-in recordings

inline void draw_size(Ints drawn, Random& random, Slot& slot) {
    const Ints car = random.uniform(drawn) < CAR_SHARE;
    const Floats u = random.uniform(drawn), w = random.uniform(drawn);
    const Floats half_length = 0.5F * (car ? 3.8F + 1.4F * u : 6.5F + 5.5F * u);
    const Floats half_width = 0.5F * (car ? 1.7F + 0.3F * w : 2.3F + 0.25F * w);
    slot.half_length = drawn ? half_length : slot.half_length;
    slot.half_width = drawn ? half_width : slot.half_width;
    slot.max_speed = drawn ? all(UNBOUNDED) : slot.max_speed;
}

// A speed that is neither too slow nor too fast for what is ahead.
inline Floats drawn_speed(Ints drawn, Random& random, const VehicleLanes& vehicle) {
    const Floats stoppable = root(2.0F * BRAKING * free_distance(vehicle));
    const Floats fastest = least(vehicle.v_max(), stoppable);
    return least(random.uniform(drawn, least_speed(vehicle), fastest), fastest);
}

// Mask: vehicle `index` stands too near one before it in the list, in a lane they share.
inline Ints crowded(const MapRows& map, const World& world, int index) {
    const Slot& own = world.slots[index];
    const Floats rear = own.position - own.half_length, front = own.position + own.half_length;
    Ints result{};
    for (int k = 0; k < index * map.link_count; ++k) {
        const Slot& other = world.slots[k / map.link_count];
        const Link r = link(map, own, other, k % map.link_count);
        const Floats there = other.position - r.offset;
        const Ints in_lane = (rear < r.end) & (there - other.half_length < r.end) & (front > r.own_begin) &
                             (other.position + other.half_length > r.other_begin);
        result |= in_lane & (magnitude(there - own.position) - (own.half_length + other.half_length) < STANDING_APART);
    }
    for (int k = 0; k < index && map.links == nullptr; ++k) {
        const Slot& other = world.slots[k];
        const Relation r = relation(map, own, other);
        const Ints entry = (rear < r.split) & (other.position - other.half_length < r.split);
        const Ints exit = r.merging & (front > r.own_end) & (other.position + other.half_length > r.other_end);
        const Floats apart =
            magnitude(other.position - r.offset - own.position) - (own.half_length + other.half_length);
        result |= (entry | exit) & (apart < STANDING_APART);
    }
    return result;
}

inline void place(const MapRows& map, int count, World& world) {
    for (int i = 0; i < count; ++i) {
        Slot& slot = world.slots[i];
        Ints drawn = all_ints(-1);
        draw_size(drawn, world.random, slot);
        slot.route = Ints{};
        slot.position = slot.speed = slot.acceleration = all(0.0F);
        for (int attempt = 0; attempt < PLACEMENTS && any(drawn); ++attempt) {
            const Ints route = world.random.index(drawn, map.route_count);
            slot.route = drawn ? route : slot.route;
            load_route(map, slot);
            const Floats position = world.random.uniform(drawn) * slot.route_length;
            slot.position = drawn ? position : slot.position;
            drawn &= crowded(map, world, i);
        }
    }
}

// The memories of the model at a start, then what each sees and decides.
template <Gap GAP>
inline void look_afresh(const MapRows& map, const GapNetwork* network, int count, World& world) {
    for (int i = 0; i < count; ++i) {
        Slot& slot = world.slots[i];
        observe_vehicle(map, slot);
        slot.delta = under_way(slot);
        slot.hold = all_ints(-1);
        slot.waited = Ints{};
        slot.left = Ints{};
    }
    decide<GAP>(map, network, count, Bodies::unseen, world);
}

// Marks the worlds in which vehicles collide that were looked at.
inline void find_collisions(const MapRows& map, int count, Bodies bodies, World& world) {
    world.collided = Ints{};
    for (int i = 0; i < count; ++i) {
        locate(map, bodies, world.slots[i]);
        for (int j = 0; j < i; ++j) {
            touch(map, bodies, world, j, i);
        }
    }
}

inline Floats violation(const Slot& slot) { return slowness(slot) + trespass(slot); }

// One trial a lane; mask of those that violate nothing.
template <Gap GAP>
inline Ints try_start(const MapRows& map, const GapNetwork* network, int count, Bodies bodies, World& world) {
    world.exists = all_ints(-1);
    place(map, count, world);
    for (int round = 0; round <= SPEED_ROUNDS; ++round) {
        if (round == 0) { // only who leads whom matters yet; a rule is cheaper than the network
            look_afresh<Gap::critical_gap>(map, nullptr, count, world);
        } else {
            look_afresh<GAP>(map, network, count, world);
        }
        Ints changed{};
        for (int i = 0; i < count && round < SPEED_ROUNDS; ++i) {
            Slot& slot = world.slots[i];
            if (round == 0) {
                slot.delta = all_ints(-1); // speeds unknown: nobody waits yet
            }
            const Ints wrong = round == 0 ? all_ints(-1) : violation(slot) > TOLERANCE;
            if (any(wrong)) {
                const Floats speed = drawn_speed(wrong, world.random, slot);
                slot.speed = wrong ? speed : slot.speed;
            }
            changed |= wrong;
        }
        if (!any(changed)) {
            break;
        }
    }
    Ints good = all_ints(-1);
    for (int i = 0; i < count; ++i) {
        good &= violation(world.slots[i]) <= TOLERANCE;
    }
    if (any(good)) {
        find_collisions(map, count, bodies, world);
        good &= ~world.collided;
    }
    return good;
}

inline void copy_lane(const World& from, int from_lane, int count, World& to, int to_lane) {
    constexpr int FIELDS = sizeof(Slot) / sizeof(Floats);
    for (int i = 0; i < count; ++i) {
        const float* source = reinterpret_cast<const float*>(&from.slots[i]);
        float* target = reinterpret_cast<float*>(&to.slots[i]);
        for (int f = 0; f < FIELDS; ++f) {
            target[f * WIDTH + to_lane] = source[f * WIDTH + from_lane];
        }
    }
}

// Gives every wanted lane a new start, observed and decided. Which trial is taken depends on the lane's stream alone,
// not on how the trials are spread over lanes. False where MOST_ROUNDS found none.
template <Gap GAP>
inline bool start(const MapRows& map, const GapNetwork* network, int count, Bodies bodies, Ints wanted, World& world,
                  World& trial) {
    const Words key = world.random.next(wanted), other_key = world.random.next(wanted);
    int tried = 0; // of every lane still pending
    int rounds = 0;
    for (unsigned pending = bits(wanted); pending != 0;) {
        int owners[WIDTH], owner_count = 0;
        for (unsigned lanes = pending; lanes != 0; lanes &= lanes - 1) {
            owners[owner_count++] = __builtin_ctz(lanes);
        }
        const int each = WIDTH / owner_count;
        Words number{}, a{}, b{};
        for (int l = 0; l < WIDTH; ++l) {
            const int owner = owners[l % owner_count];
            number[l] = static_cast<unsigned>(tried + l / owner_count);
            a[l] = key[owner];
            b[l] = other_key[owner];
        }
        for (unsigned k = 0; k < 4; ++k) {
            trial.random.s[k] = mixed(mixed(mixed(a + number * 0x9e3779b9U) ^ b) + k * 0x85ebca6bU);
        }
        const unsigned good = bits(try_start<GAP>(map, network, count, bodies, trial));
        for (int l = 0; l < each * owner_count; ++l) {
            const int owner = owners[l % owner_count];
            if ((good >> l & 1U) != 0 && (pending >> owner & 1U) != 0) {
                copy_lane(trial, l, count, world, owner);
                pending &= ~(1U << owner);
            }
        }
        tried += each;
        if (pending != 0 && ++rounds >= MOST_ROUNDS) {
            return false;
        }
    }
    world.cycle = wanted ? Ints{} : world.cycle;
    return true;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
