#include "worlds/replay.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "intersection_env/traffic.hpp"
#include "worlds/seeding.hpp"

namespace intersection_env {
namespace {

std::size_t at(long index) { return static_cast<std::size_t>(index); }

} // namespace

Replay::Replay(std::shared_ptr<const Map> map, Policy policy, bool recording, const RecordedScenes& scenes,
               std::vector<std::int32_t> actors, int worlds, Bodies bodies, Autoreset autoreset, int threads,
               const Kernel& kernel)
    : tables_(std::move(map)), policy_(std::move(policy)),
      recorded_(tables_.map(), scenes, std::move(actors), recording, policy_.gap == Gap::sumo), recording_(recording),
      worlds_(worlds), bodies_(bodies), padded_((worlds + WORLDS_PER_BLOCK - 1L) / WORLDS_PER_BLOCK * WORLDS_PER_BLOCK),
      autoreset_(autoreset), kernel_(kernel), threads_(threads) {
    if (worlds < 1 || worlds > 1 << 24) {
        throw std::invalid_argument("worlds must be from 1 to 16777216, not " + std::to_string(worlds));
    }
    make_room(buffers, worlds, vehicles());
    make_room(state_, padded_, vehicles());
    std::fill(state_.time.begin(), state_.time.end(), recorded_.first_step(0)); // lanes without a world look at track 0
    std::fill(state_.random.begin(), state_.random.end(), 1U);
    for (int thread = 0; thread < threads_.count(); ++thread) {
        workspaces_.push_back(kernel_.create_replay());
    }
    watch();
}

Replay::~Replay() {
    for (Workspace* workspace : workspaces_) {
        kernel_.destroy_replay(workspace);
    }
}

ReplayArguments Replay::arguments(Task task) const {
    ReplayArguments shared{};
    shared.map = tables_.rows();
    shared.recorded = recorded_.rows();
    shared.recording = recording_;
    shared.gap = policy_.gap;
    shared.gap_network = policy_.gap_network ? &*policy_.gap_network : nullptr;
    shared.acceleration_scale = policy_.acceleration_scale;
    shared.bodies = bodies_;
    shared.task = task;
    return shared;
}

// Does so many worlds, or tracks, some lanes at a time.
void Replay::share(int count, const ReplayArguments& shared) {
    const int lanes = kernel_.lanes;
    threads_.share((count + lanes - 1) / lanes, [&](int row, int thread) {
        ReplayArguments g = shared;
        g.first_world = static_cast<long>(row) * lanes;
        g.worlds = static_cast<int>(std::min<long>(lanes, count - g.first_world));
        kernel_.run_replay(g, *workspaces_[at(thread)]);
    });
}

// What the recorded vehicles see and say depends on the recording alone: it is found out once.
void Replay::watch() {
    ReplayArguments shared = arguments(Task::watch);
    std::vector<std::int32_t> tracks(at(recorded_.tracks()));
    std::iota(tracks.begin(), tracks.end(), 0);
    shared.given = tracks.data();
    shared.seen = recorded_.seen();
    shared.by_arrival = std::ranges::any_of(tables_.map().conflicts, &Conflict::by_arrival);
    share(recorded_.tracks(), shared);
}

void Replay::run(Task task, const std::uint8_t* wanted, const std::int32_t* given, bool desynchronise,
                 const Rollout* rollout, int steps) {
    ReplayArguments shared = arguments(task);
    shared.steps = steps;
    shared.wanted = wanted;
    shared.given = given;
    shared.desynchronise = desynchronise;
    shared.state = pointers_into<ReplayState<Pointer>>(state_, 0, vehicles());
    shared.padded = padded_;
    shared.buffers = pointers_into<ReplayBuffers<Pointer>>(buffers, 0, vehicles());
    shared.rollout = rollout;
    share(worlds_, shared);
    std::copy_n(state_.track.begin(), worlds_, buffers.track.begin());
    std::copy_n(state_.time.begin(), worlds_, buffers.time.begin());
}

void Replay::check_started() const {
    if (!started_) {
        throw std::runtime_error("the worlds must be reset first");
    }
}

std::vector<std::uint8_t> Replay::ended() const {
    std::vector<std::uint8_t> flags(at(worlds_));
    std::transform(state_.ended.begin(), state_.ended.begin() + worlds_, flags.begin(),
                   [](int mask) { return mask != 0; });
    return flags;
}

// A start that somebody asked for: no step led to it.
void Replay::restart(std::span<const std::uint8_t> wanted, const std::int32_t* given, bool desynchronise) {
    for (std::size_t world = 0; world < wanted.size(); ++world) {
        if (wanted[world] != 0) {
            forget_step(buffers, static_cast<long>(world), vehicles());
        }
    }
    run(Task::start, wanted.data(), given, desynchronise);
}

void Replay::reset(std::uint64_t seed, bool desynchronise) {
    const Claim claim(held_);
    for (long world = 0; world < worlds_; ++world) {
        const auto stream = random_stream(seed, static_cast<std::uint64_t>(world));
        for (long k = 0; k < 8; ++k) {
            state_.random[at(place(world, k))] = stream[at(k)];
        }
    }
    const std::vector<std::uint8_t> every(at(worlds_), 1);
    restart(every, nullptr, desynchronise);
    started_ = true;
}

void Replay::reset_worlds(std::span<const std::uint8_t> wanted) {
    const Claim claim(held_);
    check_started();
    if (wanted.size() != at(worlds_)) {
        throw std::invalid_argument("the mask must have one entry a world");
    }
    restart(wanted, nullptr, false);
}

void Replay::start(int world, int track) {
    const Claim claim(held_);
    check_started();
    if (world < 0 || world >= worlds_) {
        throw std::invalid_argument("there is no world " + std::to_string(world));
    }
    if (track < 0 || track >= recorded_.tracks() || recorded_.end_step(track) - recorded_.first_step(track) < 2) {
        throw std::invalid_argument("track " + std::to_string(track) + " cannot act: unknown, or too short");
    }
    std::vector<std::uint8_t> wanted(at(worlds_));
    std::vector<std::int32_t> given(at(worlds_), -1);
    wanted[at(world)] = 1;
    given[at(world)] = track;
    restart(wanted, given.data(), false);
}

void Replay::step() {
    const Claim claim(held_);
    check_started();
    if (autoreset_ == Autoreset::off) {
        run(Task::step);
        return;
    }
    const std::vector<std::uint8_t> before = ended();
    run(Task::step);
    const std::vector<std::uint8_t> again = autoreset_ == Autoreset::same_step ? ended() : before;
    if (std::find(again.begin(), again.end(), 1) != again.end()) {
        run(Task::start, again.data());
    }
}

void Replay::rollout(const Rollout& rollout, int steps) {
    const Claim claim(held_);
    check_started();
    if (autoreset_ != Autoreset::same_step) {
        throw std::invalid_argument("a rollout needs autoreset \"same_step\"");
    }
    run(Task::rollout, nullptr, nullptr, false, &rollout, steps);
}

Replay::State Replay::state() const {
    State state;
    make_room(state, worlds_, vehicles());
    for_each_number(
        state_, state, worlds_, vehicles(), [this](long world, long k, long) { return place(world, k); },
        [](auto kept, auto& shown) { shown = kept; });
    return state;
}

void Replay::check(const State& state) const {
    State::for_each([&](auto field, auto member) {
        if ((state.*member).size() != at(static_cast<long>(worlds_) * numbers_in_world(field.per, vehicles()))) {
            throw std::invalid_argument("a state's arrays must be (world,), random (world, 8)");
        }
    });
    for (std::size_t world = 0; world < state.track.size(); ++world) {
        const int track = state.track[world];
        if (track < 0 || track >= recorded_.tracks() || state.time[world] < recorded_.first_step(track) ||
            state.time[world] >= recorded_.end_step(track) || !(std::fabs(state.position[world]) < FAR) ||
            !(state.speed[world] >= 0.0F && state.speed[world] <= MOST_SPEED) ||
            !std::isfinite(state.acceleration[world]) || state.waited[world] < 0 || state.waited[world] > MOST_WAITED) {
            throw std::invalid_argument("world " + std::to_string(world) +
                                        ": its state is out of range (track, time within it, position, speed, waited)");
        }
    }
}

void Replay::set_state(const State& state) {
    const Claim claim(held_);
    check(state);
    for_each_number(
        state_, state, worlds_, vehicles(), [this](long world, long k, long) { return place(world, k); },
        [](auto& kept, auto shown) { kept = shown; });
    for (long world = 0; world < worlds_; ++world) {
        forget_step(buffers, world, vehicles());
    }
    run(Task::look);
    started_ = true;
}

} // namespace intersection_env
