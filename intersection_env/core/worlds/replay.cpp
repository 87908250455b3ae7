#include "worlds/replay.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "intersection_env/traffic.hpp"
#include "worlds/seeding.hpp"

namespace intersection_env {
namespace {

std::size_t at(long index) { return static_cast<std::size_t>(index); }

template <class Value>
std::vector<Value> first(const LaneVector<Value>& values, int count) {
    return {values.begin(), values.begin() + count};
}

std::vector<std::uint8_t> flags(const LaneVector<std::int32_t>& masks, int count) {
    std::vector<std::uint8_t> result(at(count));
    std::transform(masks.begin(), masks.begin() + count, result.begin(), [](int mask) { return mask != 0; });
    return result;
}

} // namespace

Replay::Replay(std::shared_ptr<const Map> map, Policy policy, bool recording, RecordedScenes scenes,
               std::vector<std::int32_t> actors, int worlds, Autoreset autoreset, int threads, const Kernel& kernel)
    : tables_(std::move(map)), policy_(std::move(policy)),
      recorded_(tables_.map(), std::move(scenes), std::move(actors), recording), recording_(recording), worlds_(worlds),
      padded_((worlds + BLOCK - 1L) / BLOCK * BLOCK), autoreset_(autoreset), kernel_(kernel), threads_(threads) {
    if (worlds < 1 || worlds > 1 << 24) {
        throw std::invalid_argument("worlds must be from 1 to 16777216, not " + std::to_string(worlds));
    }
    for (auto* one : {&action, &reward, &expert_acceleration}) {
        one->resize(at(worlds));
    }
    for (auto* one : {&observation, &final_observation, &expert_observation}) {
        one->resize(at(worlds) * DRIVING_INPUTS);
    }
    terminated.resize(at(worlds));
    truncated.resize(at(worlds));
    for (auto* one : {&position_, &speed_, &acceleration_}) {
        one->resize(at(padded_));
    }
    for (auto* one : {&track_, &time_, &delta_, &expert_delta_, &ended_}) {
        one->resize(at(padded_));
    }
    std::fill(time_.begin(), time_.end(), recorded_.first_step(0)); // lanes without a world look at track 0
    random_.resize(at(padded_) * 8, 1U);
    for (int thread = 0; thread < threads_.count(); ++thread) {
        workspaces_.push_back(kernel_.create_replay());
    }
    track_now.resize(at(worlds));
    time_now.resize(at(worlds));
}

Replay::~Replay() {
    for (Workspace* workspace : workspaces_) {
        kernel_.destroy_replay(workspace);
    }
}

void Replay::run(Task task, const std::uint8_t* wanted, const std::int32_t* given, bool desynchronise,
                 const Rollout* rollout, int steps) {
    ReplayArguments shared{};
    shared.tables = tables_.tables();
    shared.recorded = recorded_.tables();
    shared.recording = recording_;
    shared.gap = policy_.gap;
    shared.gap_network = policy_.gap_network ? &*policy_.gap_network : nullptr;
    shared.acceleration_scale = policy_.acceleration_scale;
    shared.task = task;
    shared.steps = steps;
    shared.wanted = wanted;
    shared.given = given;
    shared.desynchronise = desynchronise;
    shared.position = position_.data();
    shared.speed = speed_.data();
    shared.acceleration = acceleration_.data();
    shared.track = track_.data();
    shared.time = time_.data();
    shared.delta = delta_.data();
    shared.expert_delta = expert_delta_.data();
    shared.ended = ended_.data();
    shared.random = random_.data();
    shared.padded = padded_;
    shared.action = action.data();
    shared.observation = observation.data();
    shared.final_observation = final_observation.data();
    shared.reward = reward.data();
    shared.expert_observation = expert_observation.data();
    shared.expert_acceleration = expert_acceleration.data();
    shared.terminated = terminated.data();
    shared.truncated = truncated.data();
    shared.rollout = rollout;
    const int lanes = kernel_.lanes;
    threads_.share((worlds_ + lanes - 1) / lanes, [&](int row, int thread) {
        ReplayArguments g = shared;
        g.first_world = static_cast<long>(row) * lanes;
        g.worlds = static_cast<int>(std::min<long>(lanes, worlds_ - g.first_world));
        kernel_.run_replay(g, *workspaces_[at(thread)]);
    });
    std::copy_n(track_.begin(), worlds_, track_now.begin());
    std::copy_n(time_.begin(), worlds_, time_now.begin());
}

void Replay::check_started() const {
    if (!started_) {
        throw std::runtime_error("the worlds must be reset first");
    }
}

std::vector<std::uint8_t> Replay::ended() const { return flags(ended_, worlds_); }

// A start that somebody asked for: no step led to it, so there are no flags and no reward.
void Replay::restart(std::span<const std::uint8_t> wanted, const std::int32_t* given, bool desynchronise) {
    for (std::size_t world = 0; world < wanted.size(); ++world) {
        if (wanted[world] != 0) {
            terminated[world] = truncated[world] = 0;
            reward[world] = 0.0F;
        }
    }
    run(Task::start, wanted.data(), given, desynchronise);
}

void Replay::reset(std::uint64_t seed, bool desynchronise) {
    const Claim claim(held_);
    for (long world = 0; world < worlds_; ++world) {
        const auto stream = random_stream(seed, static_cast<std::uint64_t>(world));
        for (long k = 0; k < 8; ++k) {
            random_[at(k * padded_ + world)] = stream[at(k)];
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
    if (track < 0 || track >= recorded_.scenes().tracks() ||
        recorded_.end_step(track) - recorded_.first_step(track) < 2) {
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

ReplayState Replay::state() const {
    ReplayState state{first(track_, worlds_),
                      first(time_, worlds_),
                      first(position_, worlds_),
                      first(speed_, worlds_),
                      first(acceleration_, worlds_),
                      flags(delta_, worlds_),
                      flags(expert_delta_, worlds_),
                      ended(),
                      {}};
    for (long world = 0; world < worlds_; ++world) {
        for (long k = 0; k < 8; ++k) {
            state.random.push_back(random_[at(k * padded_ + world)]);
        }
    }
    return state;
}

void Replay::set_state(const ReplayState& state) {
    const Claim claim(held_);
    const std::size_t count = at(worlds_);
    if (state.track.size() != count || state.time.size() != count || state.position.size() != count ||
        state.speed.size() != count || state.acceleration.size() != count || state.delta.size() != count ||
        state.expert_delta.size() != count || state.done.size() != count || state.random.size() != count * 8) {
        throw std::invalid_argument("a state's arrays must be (world,), random (world, 8)");
    }
    for (std::size_t world = 0; world < count; ++world) {
        const int track = state.track[world];
        if (track < 0 || track >= recorded_.scenes().tracks() || state.time[world] < recorded_.first_step(track) ||
            state.time[world] >= recorded_.end_step(track) || !(std::fabs(state.position[world]) < FAR) ||
            !(state.speed[world] >= 0.0F && state.speed[world] <= MOST_SPEED) ||
            !std::isfinite(state.acceleration[world])) {
            throw std::invalid_argument("world " + std::to_string(world) +
                                        ": its state is out of range (track, time within it, position, speed)");
        }
    }
    for (long world = 0; world < worlds_; ++world) {
        track_[at(world)] = state.track[at(world)];
        time_[at(world)] = state.time[at(world)];
        position_[at(world)] = state.position[at(world)];
        speed_[at(world)] = state.speed[at(world)];
        acceleration_[at(world)] = state.acceleration[at(world)];
        delta_[at(world)] = state.delta[at(world)] != 0 ? -1 : 0;
        expert_delta_[at(world)] = state.expert_delta[at(world)] != 0 ? -1 : 0;
        ended_[at(world)] = state.done[at(world)] != 0 ? -1 : 0;
        for (long k = 0; k < 8; ++k) {
            random_[at(k * padded_ + world)] = state.random[at(world * 8 + k)];
        }
    }
    std::fill(reward.begin(), reward.end(), 0.0F);
    for (auto* flags : {&terminated, &truncated}) {
        std::fill(flags->begin(), flags->end(), std::uint8_t{0}); // no step led here
    }
    run(Task::look);
    started_ = true;
}

} // namespace intersection_env
