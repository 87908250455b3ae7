// The arrays of worlds. Each kind lists its members once, by name; whoever makes, copies, checks, hands on or shows
// them goes through that list.
#pragma once

#include <cstdint>
#include <limits>

#include "intersection_env/policy.hpp"
#include "tables/problem.hpp"

namespace intersection_env {

constexpr int WORLDS_PER_BLOCK = LANES; // on every instruction set: the widest one's lanes
constexpr int STREAM_WORDS = 4;         // of one random stream; a world has two: its own, then that of sampled actions

// What there is one number for in a world, or several.
enum class Per : std::uint8_t { world, vehicle, feature, word };

constexpr int numbers_in_world(Per per, int vehicles) {
    switch (per) {
    case Per::vehicle:
        return vehicles;
    case Per::feature:
        return vehicles * DRIVING_INPUTS;
    case Per::word:
        return 2 * STREAM_WORDS;
    default:
        return 1;
    }
}

// How numbers that the kernel keeps are shown outside, and taken from there.
struct Same {
    static auto shown(auto kept) { return kept; }
    static auto kept(auto shown) { return shown; }
};

struct Halved {
    static float shown(float kept) { return 2.0F * kept; }
    static float kept(float shown) { return 0.5F * shown; }
};

struct Finite { // kernels compute with finite numbers only
    static float shown(float kept) { return kept >= UNBOUNDED ? std::numeric_limits<float>::infinity() : kept; }
    static float kept(float shown) { return shown > UNBOUNDED ? UNBOUNDED : shown; }
};

struct Mask {
    static bool shown(std::int32_t kept) { return kept != 0; }
    static std::int32_t kept(bool shown) { return shown ? -1 : 0; }
};

template <class Kept = Same>
struct Field : Kept {
    constexpr Field(const char* name, Per per) : name(name), per(per) {}

    const char* name;
    Per per;
};

template <class Number>
using Pointer = Number*;

// for_each of the kinds below calls visit(field, member, members...): the pointer to the member of this kind, then
// those of the same name of all other kinds.

template <template <class> class Array>
struct ClosedLoopState {
    Array<std::int32_t> route;
    Array<float> position, speed, half_length, half_width, max_speed, acceleration;
    Array<std::int32_t> delta, hold, waited;
    Array<std::int32_t> cycle, ended;
    Array<std::uint32_t> random;

    template <class... Others, class Visit>
    static constexpr void for_each_of_vehicles(const Visit& visit) {
        using State = ClosedLoopState;
        visit(Field("route", Per::vehicle), &State::route, &Others::route...);
        visit(Field("position", Per::vehicle), &State::position, &Others::position...);
        visit(Field("speed", Per::vehicle), &State::speed, &Others::speed...);
        visit(Field<Halved>("length", Per::vehicle), &State::half_length, &Others::half_length...);
        visit(Field<Halved>("width", Per::vehicle), &State::half_width, &Others::half_width...);
        visit(Field<Finite>("max_speed", Per::vehicle), &State::max_speed, &Others::max_speed...);
        visit(Field("acceleration", Per::vehicle), &State::acceleration, &Others::acceleration...);
        visit(Field<Mask>("delta", Per::vehicle), &State::delta, &Others::delta...);
        visit(Field("hold", Per::vehicle), &State::hold, &Others::hold...);
        visit(Field("waited", Per::vehicle), &State::waited, &Others::waited...);
    }

    template <class... Others, class Visit>
    static constexpr void for_each(const Visit& visit) {
        using State = ClosedLoopState;
        for_each_of_vehicles<Others...>(visit);
        visit(Field("cycle", Per::world), &State::cycle, &Others::cycle...);
        visit(Field<Mask>("done", Per::world), &State::ended, &Others::ended...);
        visit(Field("random", Per::word), &State::random, &Others::random...);
    }
};

// What a step takes, `action`, and what it gives.
template <template <class> class Array>
struct ClosedLoopBuffers {
    Array<float> action, reward, observation, final_observation;
    Array<std::uint8_t> terminated, truncated, reinserted, done;

    template <class... Others, class Visit>
    static constexpr void for_each(const Visit& visit) {
        using Buffers = ClosedLoopBuffers;
        visit(Field("action", Per::vehicle), &Buffers::action, &Others::action...);
        visit(Field("reward", Per::vehicle), &Buffers::reward, &Others::reward...);
        visit(Field("observation", Per::feature), &Buffers::observation, &Others::observation...);
        visit(Field("final_observation", Per::feature), &Buffers::final_observation, &Others::final_observation...);
        visit(Field("terminated", Per::vehicle), &Buffers::terminated, &Others::terminated...);
        visit(Field("truncated", Per::vehicle), &Buffers::truncated, &Others::truncated...);
        visit(Field("reinserted", Per::vehicle), &Buffers::reinserted, &Others::reinserted...);
        visit(Field("done", Per::world), &Buffers::done, &Others::done...);
    }
};

template <template <class> class Array>
struct ReplayState {
    Array<std::int32_t> track, time;
    Array<float> position, speed, acceleration;
    Array<std::int32_t> delta, expert_delta, waited, ended;
    Array<std::uint32_t> random;

    template <class... Others, class Visit>
    static constexpr void for_each(const Visit& visit) {
        using State = ReplayState;
        visit(Field("track", Per::world), &State::track, &Others::track...);
        visit(Field("time", Per::world), &State::time, &Others::time...);
        visit(Field("position", Per::world), &State::position, &Others::position...);
        visit(Field("speed", Per::world), &State::speed, &Others::speed...);
        visit(Field("acceleration", Per::world), &State::acceleration, &Others::acceleration...);
        visit(Field<Mask>("delta", Per::world), &State::delta, &Others::delta...);
        visit(Field<Mask>("expert_delta", Per::world), &State::expert_delta, &Others::expert_delta...);
        visit(Field("waited", Per::world), &State::waited, &Others::waited...);
        visit(Field<Mask>("done", Per::world), &State::ended, &Others::ended...);
        visit(Field("random", Per::word), &State::random, &Others::random...);
    }
};

// What a step takes, `action`, and what it gives; the features are those of the acting vehicle.
template <template <class> class Array>
struct ReplayBuffers {
    Array<float> action, reward, expert_acceleration, observation, final_observation, expert_observation;
    Array<std::uint8_t> terminated, truncated;
    Array<std::int32_t> track, time;

    template <class... Others, class Visit>
    static constexpr void for_each(const Visit& visit) {
        using Buffers = ReplayBuffers;
        visit(Field("action", Per::world), &Buffers::action, &Others::action...);
        visit(Field("reward", Per::world), &Buffers::reward, &Others::reward...);
        visit(Field("expert_acceleration", Per::world), &Buffers::expert_acceleration, &Others::expert_acceleration...);
        visit(Field("observation", Per::feature), &Buffers::observation, &Others::observation...);
        visit(Field("final_observation", Per::feature), &Buffers::final_observation, &Others::final_observation...);
        visit(Field("expert_observation", Per::feature), &Buffers::expert_observation, &Others::expert_observation...);
        visit(Field("terminated", Per::world), &Buffers::terminated, &Others::terminated...);
        visit(Field("truncated", Per::world), &Buffers::truncated, &Others::truncated...);
        visit(Field("track", Per::world), &Buffers::track, &Others::track...);
        visit(Field("time", Per::world), &Buffers::time, &Others::time...);
    }
};

template <class Pointers>
constexpr bool lists_all_its_members() {
    unsigned long listed = 0;
    Pointers::for_each([&listed](const auto&, auto) { ++listed; });
    return listed * sizeof(void*) == sizeof(Pointers);
}
static_assert(lists_all_its_members<ClosedLoopState<Pointer>>() && lists_all_its_members<ClosedLoopBuffers<Pointer>>());
static_assert(lists_all_its_members<ReplayState<Pointer>>() && lists_all_its_members<ReplayBuffers<Pointer>>());

} // namespace intersection_env
