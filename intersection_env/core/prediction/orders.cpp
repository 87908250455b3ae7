#include "intersection_env/orders.hpp"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>

namespace intersection_env {
namespace {

constexpr std::size_t CYCLE = 2'400'000; // ours: orders times squared vehicles that 50 ms suffice for

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

// Who of a pair goes first by the precedence; 0 if either may.
std::int8_t direction_of(const Precedence& precedence, const Pair& pair) {
    const bool yielder_first = precedence.before(pair.yielder, pair.prioritized);
    return yielder_first ? 1 : precedence.before(pair.prioritized, pair.yielder) ? -1 : 0;
}

// What follows for a pair from the precedence; nothing where neither vehicle can stop any more.
std::int8_t implied(const Precedence& precedence, const Pair& pair, const std::vector<std::uint8_t>& committed) {
    const bool both_go = committed[at(pair.yielder)] != 0 && committed[at(pair.prioritized)] != 0;
    return both_go ? std::int8_t{0} : direction_of(precedence, pair);
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

Precedence& Precedence::operator=(const Precedence& other) {
    if (this != &other) {
        vehicles_ = other.vehicles_;
        std::copy_n(other.after_.begin(), vehicles_, after_.begin());
    }
    return *this;
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
        row |= later & (std::uint64_t{0} - (row >> a & 1U)); // without a branch: the search's innermost loop
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
            follow_.push_back(p);
            continue;
        }
        const bool yielder_goes = committed_[at(pair.yielder)] != 0;
        const bool prioritized_goes = committed_[at(pair.prioritized)] != 0;
        if (yielder_goes && prioritized_goes) {
            continue; // neither can stop: nothing to decide, and nothing follows
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

// What every order holds; no order is left where it contradicts what others hold, or what vehicles can still do.
void Orders::settle(std::size_t pair, std::int8_t direction) {
    const int first = first_of(pairs_[pair], direction), second = second_of(pairs_[pair], direction);
    order_[pair] = direction;
    finished_ = finished_ || cannot_wait(pairs_[pair], direction, passed_[pair] != 0, committed_) ||
                !precedence_.add(first, second);
}

void Orders::orient(std::size_t depth, std::int8_t direction) {
    const Pair& pair = pairs_[open_[depth]];
    order_[open_[depth]] = direction;
    precedence_.add(first_of(pair, direction), second_of(pair, direction));
}

bool Orders::advance() {
    if (started_ && made_ == 0) {
        finished_ = true;
    }
    if (finished_) {
        return false;
    }
    // Every partial order can be completed, so the search never walks into a dead end.
    std::size_t depth = 0;
    if (started_) {
        const Choice& last = choices_[--made_];
        precedence_ = last.before;
        orient(last.depth, static_cast<std::int8_t>(-order_[open_[last.depth]]));
        depth = last.depth + 1;
    }
    started_ = true;
    for (; depth < open_.size(); ++depth) {
        const std::size_t p = open_[depth];
        const std::int8_t follows = direction_of(precedence_, pairs_[p]);
        if (follows != 0) {
            order_[p] = follows;
            continue;
        }
        Choice& choice = choices_[made_++];
        choice.depth = depth;
        choice.before = precedence_;
        orient(depth, preferred_[p] > 0 ? std::int8_t{1} : std::int8_t{-1});
    }
    return true;
}

// The order found, with what it implies for pairs that were not oriented; false if that cannot be carried out.
bool Orders::complete_into(std::int8_t* out) const {
    std::ranges::copy(order_, out);
    for (const std::size_t p : follow_) {
        out[p] = implied(precedence_, pairs_[p], committed_);
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
