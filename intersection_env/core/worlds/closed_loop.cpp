#include "worlds/closed_loop.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "worlds/seeding.hpp"

namespace intersection_env {
namespace {

std::size_t at(long index) { return static_cast<std::size_t>(index); }

int checked(const char* what, int value, int least, int most) {
    if (value < least || value > most) {
        throw std::invalid_argument(std::string(what) + " must be from " + std::to_string(least) + " to " +
                                    std::to_string(most) + ", not " + std::to_string(value));
    }
    return value;
}

bool is_within(float value, float least, float most) { return value >= least && value <= most; }

// Where the k-th of a world's `count` numbers lies in the blocks.
long place_in_blocks(long world, long k, long count) {
    return (world / WORLDS_PER_BLOCK * count + k) * WORLDS_PER_BLOCK + world % WORLDS_PER_BLOCK;
}

} // namespace

ClosedLoop::ClosedLoop(std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles, int max_cycles,
                       Bodies bodies, Autoreset autoreset, int threads, const Kernel& kernel)
    : tables_(std::move(map)), policy_(std::move(policy)), worlds_(checked("worlds", worlds, 1, 1 << 24)),
      vehicles_(checked("vehicles", vehicles, 1, MAX_VEHICLES)),
      max_cycles_(checked("max_cycles", max_cycles, 1, 1 << 24)),
      blocks_((worlds + WORLDS_PER_BLOCK - 1) / WORLDS_PER_BLOCK), bodies_(bodies), autoreset_(autoreset),
      kernel_(kernel), threads_(threads) {
    make_room(buffers, worlds, vehicles);
    make_room(state_, static_cast<long>(blocks_) * WORLDS_PER_BLOCK, vehicles);
    std::fill(state_.max_speed.begin(), state_.max_speed.end(), UNBOUNDED);
    for (int thread = 0; thread < threads_.count(); ++thread) {
        workspaces_.push_back(kernel_.create_closed_loop());
    }
}

ClosedLoop::~ClosedLoop() {
    for (Workspace* workspace : workspaces_) {
        kernel_.destroy_closed_loop(workspace);
    }
}

// Everything a kernel needs for the worlds of one block on.
ClosedLoopArguments ClosedLoop::arguments(long block, Task task) {
    ClosedLoopArguments g{};
    const long first = block * WORLDS_PER_BLOCK;
    g.map = tables_.rows();
    g.gap = policy_.gap;
    g.gap_network = policy_.gap_network ? &*policy_.gap_network : nullptr;
    g.acceleration_scale = policy_.acceleration_scale;
    g.vehicles = vehicles_;
    g.bodies = bodies_;
    g.max_cycles = max_cycles_;
    g.task = task;
    g.first_world = first;
    g.worlds = static_cast<int>(std::min<long>(WORLDS_PER_BLOCK, worlds_ - first));
    g.state = pointers_into<ClosedLoopState<Pointer>>(state_, first, vehicles_);
    g.buffers = pointers_into<ClosedLoopBuffers<Pointer>>(buffers, first, vehicles_);
    return g;
}

void ClosedLoop::run(Task task, const Rollout* rollout, int steps) {
    std::atomic<bool> found = true;
    threads_.share(blocks_, [&](int block, int thread) {
        ClosedLoopArguments g = arguments(block, task);
        g.rollout = rollout;
        g.steps = steps;
        for (int lane = 0; lane < g.worlds; lane += kernel_.lanes) {
            g.first_lane = lane;
            if (!kernel_.run_closed_loop(g, *workspaces_[at(thread)])) {
                found = false;
            }
        }
    });
    if (!found) {
        refuse_start();
    }
}

void ClosedLoop::start(const std::vector<std::int32_t>& listed, bool desynchronise) {
    std::atomic<bool> found = true;
    const int lanes = kernel_.lanes, count = static_cast<int>(listed.size());
    threads_.share((count + lanes - 1) / lanes, [&](int row, int thread) {
        if (!found) {
            return; // one start that is not found is enough
        }
        ClosedLoopArguments g = arguments(0, Task::start);
        g.listed = listed.data() + static_cast<long>(row) * lanes;
        g.listed_count = std::min(lanes, count - row * lanes);
        g.desynchronise = desynchronise;
        if (!kernel_.run_closed_loop(g, *workspaces_[at(thread)])) {
            found = false;
        }
    });
    if (!found) {
        refuse_start();
    }
}

// A start that somebody asked for: no step led to it.
void ClosedLoop::restart(const std::vector<std::int32_t>& listed, bool desynchronise) {
    for (const std::int32_t world : listed) {
        forget_step(buffers, world, vehicles_);
    }
    start(listed, desynchronise);
}

void ClosedLoop::refuse_start() const {
    throw std::runtime_error("no start of " + std::to_string(vehicles_) + " vehicles on map \"" + tables_.map().name +
                             "\" that violates no constraint was found; take fewer vehicles");
}

std::vector<std::int32_t> ClosedLoop::ended() const {
    std::vector<std::int32_t> list;
    for (std::int32_t world = 0; world < worlds_; ++world) {
        if (state_.ended[at(world)] != 0) {
            list.push_back(world);
        }
    }
    return list;
}

void ClosedLoop::reset(std::uint64_t seed, bool desynchronise) {
    const Claim claim(held_);
    std::vector<std::int32_t> every;
    for (std::int32_t world = 0; world < worlds_; ++world) {
        const auto stream = random_stream(seed, static_cast<std::uint64_t>(world));
        for (long k = 0; k < 8; ++k) {
            state_.random[at(place_in_blocks(world, k, 8))] = stream[at(k)];
        }
        every.push_back(world);
    }
    restart(every, desynchronise);
    started_ = true;
}

void ClosedLoop::reset_worlds(std::span<const std::uint8_t> wanted) {
    const Claim claim(held_);
    check_started();
    if (wanted.size() != at(worlds_)) {
        throw std::invalid_argument("the mask must have one entry a world");
    }
    std::vector<std::int32_t> list;
    for (std::int32_t world = 0; world < worlds_; ++world) {
        if (wanted[at(world)] != 0) {
            list.push_back(world);
        }
    }
    restart(list, false);
}

void ClosedLoop::step() {
    const Claim claim(held_);
    check_started();
    const std::vector<std::int32_t> before = autoreset_ == Autoreset::next_step ? ended() : std::vector<std::int32_t>();
    run(Task::step);
    start(autoreset_ == Autoreset::same_step ? ended() : before, false);
}

void ClosedLoop::rollout(const Rollout& rollout, int steps) {
    const Claim claim(held_);
    check_started();
    if (autoreset_ != Autoreset::same_step) {
        throw std::invalid_argument("a rollout needs autoreset \"same_step\"");
    }
    run(Task::rollout, &rollout, steps);
}

void ClosedLoop::check_started() const {
    if (!started_) {
        throw std::runtime_error("the worlds must be reset first");
    }
}

ClosedLoop::State ClosedLoop::state() const {
    State state;
    make_room(state, worlds_, vehicles_);
    for_each_number(state_, state, worlds_, vehicles_, place_in_blocks, [](auto kept, auto& shown) { shown = kept; });
    return state;
}

void ClosedLoop::check(const State& state) const {
    bool floats_fit = true, all_fit = true;
    State::for_each([&](auto field, auto member) {
        const long count = static_cast<long>(worlds_) * numbers_in_world(field.per, vehicles_);
        const bool fits = (state.*member).size() == at(count);
        all_fit = all_fit && fits;
        floats_fit = floats_fit && (fits || !std::is_same_v<decltype(member), Values<float> State::*>);
    });
    if (!floats_fit) {
        throw std::invalid_argument("a state's arrays must be (world, vehicle)");
    }
    if (!all_fit) {
        throw std::invalid_argument("a state's arrays must be (world, vehicle), cycle and done (world,), "
                                    "random (world, 8)");
    }
    const int routes = static_cast<int>(tables_.map().routes.size());
    for (std::size_t k = 0; k < state.route.size(); ++k) {
        const bool known = state.route[k] >= 0 && state.route[k] < routes;
        const float most = known ? tables_.map().routes[at(state.route[k])].length : 0.0F;
        if (!known || !is_within(state.position[k], 0.0F, most) || !(std::fabs(state.speed[k]) <= MOST_SPEED) ||
            !is_within(2.0F * state.half_length[k], LEAST_SIZE, MOST_LENGTH) ||
            !is_within(2.0F * state.half_width[k], LEAST_SIZE, MOST_WIDTH) || !(state.max_speed[k] >= 0.1F) ||
            !std::isfinite(state.acceleration[k]) || state.hold[k] < -1 || state.hold[k] > routes ||
            state.waited[k] < 0 || state.waited[k] > MOST_WAITED) {
            throw std::invalid_argument("world " + std::to_string(k / at(vehicles_)) + ", vehicle " +
                                        std::to_string(k % at(vehicles_)) +
                                        ": its state is out of range (route, position on it, speed up to 100 m/s, "
                                        "size, hold, waited)");
        }
    }
}

void ClosedLoop::set_state(const State& state) {
    const Claim claim(held_);
    check(state);
    for (long world = 0; world < worlds_; ++world) {
        forget_step(buffers, world, vehicles_);
    }
    for_each_number(state_, state, worlds_, vehicles_, place_in_blocks, [](auto& kept, auto shown) { kept = shown; });
    run(Task::look);
    started_ = true;
}

} // namespace intersection_env
