#include "worlds/closed_loop.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <string>

#include "tables/lane_vector.hpp"
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

} // namespace

struct ClosedLoop::Aligned {
    LaneVector<float> position, speed, half_length, half_width, max_speed, acceleration;
    LaneVector<std::int32_t> route, delta, hold, cycle, ended;
    LaneVector<std::uint32_t> random;
};

ClosedLoop::ClosedLoop(std::shared_ptr<const Map> map, Policy policy, int worlds, int vehicles, int max_cycles,
                       Autoreset autoreset, int threads, const Kernel& kernel)
    : tables_(std::move(map)), policy_(std::move(policy)), worlds_(checked("worlds", worlds, 1, 1 << 24)),
      vehicles_(checked("vehicles", vehicles, 1, MAX_VEHICLES)),
      max_cycles_(checked("max_cycles", max_cycles, 1, 1 << 24)), blocks_((worlds + BLOCK - 1) / BLOCK),
      autoreset_(autoreset), kernel_(kernel), threads_(threads), aligned_(std::make_unique<Aligned>()) {
    const std::size_t agents = at(static_cast<long>(worlds) * vehicles);
    action.resize(agents);
    reward.resize(agents);
    terminated.resize(agents);
    truncated.resize(agents);
    reinserted.resize(agents);
    observation.resize(agents * DRIVING_INPUTS);
    final_observation.resize(agents * DRIVING_INPUTS);
    done.resize(at(worlds));
    const std::size_t lanes = at(static_cast<long>(blocks_) * BLOCK), slots = lanes * at(vehicles);
    for (auto* field : {&aligned_->position, &aligned_->speed, &aligned_->half_length, &aligned_->half_width,
                        &aligned_->max_speed, &aligned_->acceleration}) {
        field->resize(slots);
    }
    for (auto* field : {&aligned_->route, &aligned_->delta, &aligned_->hold}) {
        field->resize(slots);
    }
    std::fill(aligned_->max_speed.begin(), aligned_->max_speed.end(), UNBOUNDED);
    aligned_->cycle.resize(lanes);
    aligned_->ended.resize(lanes);
    aligned_->random.resize(lanes * 8);
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
    const long first = block * BLOCK, agents = first * vehicles_;
    Aligned& s = *aligned_;
    g.tables = tables_.tables();
    g.gap = policy_.gap;
    g.gap_network = policy_.gap_network ? &*policy_.gap_network : nullptr;
    g.acceleration_scale = policy_.acceleration_scale;
    g.vehicles = vehicles_;
    g.max_cycles = max_cycles_;
    g.task = task;
    g.worlds = static_cast<int>(std::min<long>(BLOCK, worlds_ - first));
    g.position = s.position.data() + agents;
    g.speed = s.speed.data() + agents;
    g.half_length = s.half_length.data() + agents;
    g.half_width = s.half_width.data() + agents;
    g.max_speed = s.max_speed.data() + agents;
    g.acceleration = s.acceleration.data() + agents;
    g.route = s.route.data() + agents;
    g.delta = s.delta.data() + agents;
    g.hold = s.hold.data() + agents;
    g.cycle = s.cycle.data() + first;
    g.ended = s.ended.data() + first;
    g.random = s.random.data() + first * 8;
    g.action = action.data() + agents;
    g.observation = observation.data() + agents * DRIVING_INPUTS;
    g.final_observation = final_observation.data() + agents * DRIVING_INPUTS;
    g.reward = reward.data() + agents;
    g.terminated = terminated.data() + agents;
    g.truncated = truncated.data() + agents;
    g.reinserted = reinserted.data() + agents;
    g.done = done.data() + first;
    return g;
}

void ClosedLoop::run(Task task, const Rollout* whole, int steps) {
    std::atomic<bool> found = true;
    threads_.share(blocks_, [&](int block, int thread) {
        ClosedLoopArguments g = arguments(block, task);
        Rollout part;
        if (whole != nullptr) {
            const long before = static_cast<long>(block) * BLOCK * steps * vehicles_;
            part = *whole;
            part.observation += before * DRIVING_INPUTS;
            for (float** results :
                 {&part.latent, &part.log_probability, &part.value_now, &part.value_next, &part.reward}) {
                *results += before;
            }
            part.terminated += before;
            part.cut += before;
            g.rollout = &part;
            g.steps = steps;
        }
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

// A start that somebody asked for: no step led to it, so there are no flags and no reward.
void ClosedLoop::restart(const std::vector<std::int32_t>& listed, bool desynchronise) {
    for (const std::int32_t world : listed) {
        const std::size_t first = at(static_cast<long>(world) * vehicles_), count = at(vehicles_);
        for (auto* flags : {&terminated, &truncated, &reinserted}) {
            std::fill_n(flags->begin() + static_cast<long>(first), count, std::uint8_t{0});
        }
        std::fill_n(reward.begin() + static_cast<long>(first), count, 0.0F);
        done[at(world)] = 0;
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
        if (aligned_->ended[at(world)] != 0) {
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
            aligned_->random[at((world / BLOCK * 8 + k) * BLOCK + world % BLOCK)] = stream[at(k)];
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

// No step led to where the worlds are now.
void ClosedLoop::forget_step() {
    std::fill(reward.begin(), reward.end(), 0.0F);
    for (auto* flags : {&terminated, &truncated, &reinserted, &done}) {
        std::fill(flags->begin(), flags->end(), std::uint8_t{0});
    }
}

ClosedLoopState ClosedLoop::state() const {
    ClosedLoopState state;
    for (long world = 0; world < worlds_; ++world) {
        const long block = world / BLOCK, lane = world % BLOCK;
        for (long vehicle = 0; vehicle < vehicles_; ++vehicle) {
            const std::size_t k = at((block * vehicles_ + vehicle) * BLOCK + lane);
            state.route.push_back(aligned_->route[k]);
            state.position.push_back(aligned_->position[k]);
            state.speed.push_back(aligned_->speed[k]);
            state.length.push_back(2.0F * aligned_->half_length[k]);
            state.width.push_back(2.0F * aligned_->half_width[k]);
            const float top = aligned_->max_speed[k];
            state.max_speed.push_back(top >= UNBOUNDED ? INFINITY : top);
            state.acceleration.push_back(aligned_->acceleration[k]);
            state.delta.push_back(aligned_->delta[k] != 0);
            state.hold.push_back(aligned_->hold[k]);
        }
        state.cycle.push_back(aligned_->cycle[at(world)]);
        state.done.push_back(aligned_->ended[at(world)] != 0);
        for (long k = 0; k < 8; ++k) {
            state.random.push_back(aligned_->random[at((block * 8 + k) * BLOCK + lane)]);
        }
    }
    return state;
}

void ClosedLoop::check(const ClosedLoopState& state) const {
    const std::size_t agents = at(static_cast<long>(worlds_) * vehicles_);
    for (const auto* field :
         {&state.position, &state.speed, &state.length, &state.width, &state.max_speed, &state.acceleration}) {
        if (field->size() != agents) {
            throw std::invalid_argument("a state's arrays must be (world, vehicle)");
        }
    }
    if (state.route.size() != agents || state.hold.size() != agents || state.delta.size() != agents ||
        state.cycle.size() != at(worlds_) || state.done.size() != at(worlds_) ||
        state.random.size() != at(worlds_) * 8) {
        throw std::invalid_argument("a state's arrays must be (world, vehicle), cycle and done (world,), "
                                    "random (world, 8)");
    }
    const int routes = static_cast<int>(tables_.map().routes.size());
    for (std::size_t k = 0; k < agents; ++k) {
        const bool known = state.route[k] >= 0 && state.route[k] < routes;
        const float most = known ? tables_.map().routes[at(state.route[k])].length : 0.0F;
        if (!known || !(state.position[k] >= 0.0F && state.position[k] <= most) ||
            !(std::fabs(state.speed[k]) <= MOST_SPEED) || !(state.length[k] >= LEAST_SIZE) ||
            !(state.length[k] <= MOST_LENGTH) || !(state.width[k] >= LEAST_SIZE) || !(state.width[k] <= MOST_WIDTH) ||
            !(state.max_speed[k] >= 0.1F) || !std::isfinite(state.acceleration[k]) || state.hold[k] < -1 ||
            state.hold[k] > routes) {
            throw std::invalid_argument("world " + std::to_string(k / at(vehicles_)) + ", vehicle " +
                                        std::to_string(k % at(vehicles_)) +
                                        ": its state is out of range (route, position on it, speed up to 100 m/s, "
                                        "size, hold)");
        }
    }
}

void ClosedLoop::set_state(const ClosedLoopState& state) {
    const Claim claim(held_);
    check(state);
    forget_step();
    for (long world = 0; world < worlds_; ++world) {
        const long block = world / BLOCK, lane = world % BLOCK;
        for (long vehicle = 0; vehicle < vehicles_; ++vehicle) {
            const std::size_t k = at((block * vehicles_ + vehicle) * BLOCK + lane), w = at(world * vehicles_ + vehicle);
            aligned_->route[k] = state.route[w];
            aligned_->position[k] = state.position[w];
            aligned_->speed[k] = state.speed[w];
            aligned_->half_length[k] = 0.5F * state.length[w];
            aligned_->half_width[k] = 0.5F * state.width[w];
            aligned_->max_speed[k] = std::min(state.max_speed[w], UNBOUNDED);
            aligned_->acceleration[k] = state.acceleration[w];
            aligned_->delta[k] = state.delta[w] != 0 ? -1 : 0;
            aligned_->hold[k] = state.hold[w];
        }
        aligned_->cycle[at(world)] = state.cycle[at(world)];
        aligned_->ended[at(world)] = state.done[at(world)] != 0 ? -1 : 0;
        for (long k = 0; k < 8; ++k) {
            aligned_->random[at((block * 8 + k) * BLOCK + lane)] = state.random[at(world * 8 + k)];
        }
    }
    run(Task::look);
    started_ = true;
}

} // namespace intersection_env
