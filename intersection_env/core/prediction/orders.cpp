#include "intersection_env/orders.hpp"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>

namespace intersection_env {
namespace {

constexpr std::size_t CYCLE = 600'000; // ours: orders times squared vehicles that 50 ms suffice for

std::size_t at(int index) { return static_cast<std::size_t>(index); }

Precedence preceding(const std::vector<Pair>& order, int vehicles) {
    Precedence precedence(vehicles);
    for (const Pair& pair : order) {
        precedence.add(pair.yielder, pair.prioritized);
    }
    return precedence;
}

void mark_committed(const Map& map, const Traffic& traffic, std::vector<std::uint8_t>& flags) {
    flags.clear();
    for (int i = 0; i < traffic.count(); ++i) {
        flags.push_back(committed(map, traffic, i) ? 1 : 0);
    }
}

void mark_passed(const Map& map, const Traffic& traffic, std::span<const Pair> pairs,
                 std::vector<std::uint8_t>& flags) {
    flags.clear();
    for (const auto& [i, j] : pairs) {
        const Conflict& conflict = *map.conflict(traffic.route[at(i)], traffic.route[at(j)]);
        flags.push_back(traffic.position[at(i)] >= conflict.on_yielder.end ? 1 : 0);
    }
}

int first_of(const Pair& pair, int direction) { return direction > 0 ? pair.yielder : pair.prioritized; }
int second_of(const Pair& pair, int direction) { return direction > 0 ? pair.prioritized : pair.yielder; }

// What follows for a pair from the precedence; nothing where neither vehicle can stop any more.
std::int8_t implied(const Precedence& precedence, const Pair& pair, const std::vector<std::uint8_t>& committed) {
    if (committed[at(pair.yielder)] != 0 && committed[at(pair.prioritized)] != 0) {
        return 0;
    }
    const bool yielder_first = precedence.before(pair.yielder, pair.prioritized);
    return yielder_first ? 1 : precedence.before(pair.prioritized, pair.yielder) ? -1 : 0;
}

// Whether a direction makes a vehicle wait that can no longer stop. passed: the yielder's centre has left the conflict.
bool cannot_wait(const Pair& pair, int direction, bool passed, const std::vector<std::uint8_t>& committed) {
    return direction != 0 && !(direction > 0 && passed) && committed[at(second_of(pair, direction))] != 0;
}

std::string vehicle(int index) { return "vehicle " + std::to_string(index); }

} // namespace

std::size_t orders_in_a_cycle(int vehicles) {
    const auto squared = static_cast<std::size_t>(vehicles) * static_cast<std::size_t>(vehicles);
    return std::clamp(CYCLE / std::max<std::size_t>(squared, 1), std::size_t{1}, MOST_MANEUVERS);
}

bool Precedence::add(int a, int b) {
    if (before(b, a) || a == b) {
        return false;
    }
    if (before(a, b)) {
        return true;
    }
    const std::uint64_t later = after_[at(b)] | std::uint64_t{1} << b;
    after_[at(a)] |= later;
    for (int earlier = 0; earlier < vehicles_; ++earlier) {
        std::uint64_t& row = after_[at(earlier)];
        if ((row >> a & 1U) != 0U) {
            row |= later;
        }
    }
    return true;
}

Orders::Orders(const Map& map, const Traffic& traffic, std::span<const Pair> pairs, const OrderSearch& search)
    : pairs_(pairs.begin(), pairs.end()), preferred_(search.preferred.begin(), search.preferred.end()),
      order_(pairs.size(), 0), precedence_(preceding(lane_order(map, traffic), traffic.count())) {
    mark_committed(map, traffic, committed_);
    mark_passed(map, traffic, pairs_, passed_);
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
        const Pair& pair = pairs_[p];
        if (!search.given.empty() && search.given[p] != 0) {
            settle(p, search.given[p]);
            continue;
        }
        if (search.cooperative[at(pair.yielder)] == 0 || search.cooperative[at(pair.prioritized)] == 0) {
            continue;
        }
        const bool yielder_goes = committed_[at(pair.yielder)] != 0;
        const bool prioritized_goes = committed_[at(pair.prioritized)] != 0;
        if (yielder_goes && prioritized_goes) {
            continue; // neither can stop: nothing to decide
        }
        if (yielder_goes || prioritized_goes) {
            settle(p, yielder_goes ? 1 : -1);
        } else {
            open_.push_back(p);
        }
    }
    if (!search.certainty.empty()) {
        std::ranges::stable_sort(open_, std::greater{}, [&](std::size_t p) { return search.certainty[p]; });
    }
    choices_.resize(open_.size());
}

// What every order holds; no order is left where it contradicts what others hold.
void Orders::settle(std::size_t pair, std::int8_t direction) {
    order_[pair] = direction;
    finished_ = finished_ || !precedence_.add(first_of(pairs_[pair], direction), second_of(pairs_[pair], direction));
}

std::int8_t Orders::direction(std::size_t depth, int attempt) const {
    const std::int8_t liked = preferred_[open_[depth]] > 0 ? 1 : -1;
    return attempt == 0 ? liked : static_cast<std::int8_t>(-liked);
}

bool Orders::orient(std::size_t depth, int direction) {
    const Pair& pair = pairs_[open_[depth]];
    return precedence_.add(first_of(pair, direction), second_of(pair, direction));
}

bool Orders::advance() {
    if (finished_) {
        return false;
    }
    // Every partial order can be completed, so the search never walks into a dead end.
    std::size_t depth = 0;
    if (started_) {
        depth = open_.size();
        while (true) {
            if (depth == 0) {
                finished_ = true;
                return false;
            }
            --depth;
            precedence_ = choices_[depth].before_choice;
            const std::int8_t second = direction(depth, 1);
            if (choices_[depth].tried == 1 && orient(depth, second)) {
                choices_[depth].tried = 2;
                order_[open_[depth]] = second;
                ++depth;
                break;
            }
        }
    }
    started_ = true;
    for (; depth < open_.size(); ++depth) {
        choices_[depth].before_choice = precedence_;
        choices_[depth].tried = 1;
        std::int8_t chosen = direction(depth, 0);
        if (!orient(depth, chosen)) {
            chosen = direction(depth, 1);
            choices_[depth].tried = 2;
            orient(depth, chosen);
        }
        order_[open_[depth]] = chosen;
    }
    return true;
}

// The order found, with what it implies for pairs that were not oriented; false if that cannot be carried out.
bool Orders::complete_into(std::int8_t* out) const {
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
        out[p] = order_[p] != 0 ? order_[p] : implied(precedence_, pairs_[p], committed_);
        if (cannot_wait(pairs_[p], out[p], passed_[p] != 0, committed_)) {
            return false;
        }
    }
    return true;
}

std::size_t Orders::next(std::int8_t* out, std::size_t most) {
    std::size_t written = 0;
    while (written < most && advance()) {
        if (complete_into(out)) {
            out += pairs_.size();
            ++written;
        }
    }
    return written;
}

std::size_t Orders::count_remaining(std::size_t most) const {
    Orders copy = *this;
    std::vector<std::int8_t> order(pairs_.size() + 1);
    std::size_t count = 0;
    while (count < most && copy.next(order.data(), 1) == 1) {
        ++count;
    }
    return count;
}

void Completion::prepare(const Map& map, const Traffic& traffic, std::span<const Pair> pairs) {
    pairs_ = pairs;
    lane_order(map, traffic, order_);
    lanes_ = preceding(order_, traffic.count());
    mark_committed(map, traffic, committed_);
    mark_passed(map, traffic, pairs, passed_);
}

void Completion::complete(std::span<std::int8_t> assignments) const {
    if (std::all_of(assignments.begin(), assignments.end(), [](std::int8_t direction) { return direction == 0; })) {
        return; // the lane order alone implies nothing: vehicles of one lane do not conflict
    }
    Precedence precedence = lanes_;
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
        const int direction = assignments[p];
        if (direction == 0) {
            continue;
        }
        const int first = first_of(pairs_[p], direction), second = second_of(pairs_[p], direction);
        if (!precedence.add(first, second)) {
            throw std::invalid_argument(vehicle(first) + " cannot go before " + vehicle(second) +
                                        ": the lane order or the other priorities put it after");
        }
    }
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
        const Pair& pair = pairs_[p];
        if (assignments[p] == 0) {
            assignments[p] = implied(precedence, pair, committed_);
        }
        const int direction = assignments[p];
        if (cannot_wait(pair, direction, passed_[p] != 0, committed_)) {
            throw std::invalid_argument(vehicle(second_of(pair, direction)) + " cannot wait for " +
                                        vehicle(first_of(pair, direction)) + ": it can no longer stop");
        }
    }
}

} // namespace intersection_env
