// Crossing orders: acyclic orientations of the conflicting pairs, under lane order and what vehicles can still do.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "intersection_env/traffic.hpp"

namespace intersection_env {

// Ours: a tenth of a second's work for 30 vehicles; a dense traffic can have millions of orders.
constexpr std::size_t MOST_MANEUVERS = 10000;
constexpr std::size_t MOST_COUNTED = 20000; // ours: orders left out are counted this far, which takes some 5 ms

// As many orders of so many vehicles as a planner's cycle has time for, some 50 ms on one core; at most MOST_MANEUVERS.
std::size_t orders_in_a_cycle(int vehicles);

// How many orders a ranking may predict.
struct Budget {
    std::optional<std::size_t> orders{};                      // none: orders_in_a_cycle
    double seconds = std::numeric_limits<double>::infinity(); // then it ends too; what comes out depends on the machine
};

// Who precedes whom, closed under transitivity. Vehicles are bits.
class Precedence {
  public:
    explicit Precedence(int vehicles) : vehicles_(vehicles) {}
    Precedence(const Precedence& other) = default;
    ~Precedence() = default;
    Precedence& operator=(const Precedence& other); // copies what is in use, as searches go back often

    bool before(int a, int b) const { return (after_[static_cast<std::size_t>(a)] >> b & 1U) != 0U; }
    // False, and nothing changes, if b precedes a already.
    bool add(int a, int b);

  private:
    int vehicles_;
    std::array<std::uint64_t, MAX_VEHICLES> after_{}; // after_[a]: all that come after a
};

// Which orders are wanted, and which come first.
struct OrderSearch {
    std::span<const std::uint8_t> cooperative; // one flag a vehicle; pairs without two cooperative ends are left alone
    std::span<const std::int8_t> preferred;    // one direction a pair, near which to begin
    std::span<const float> certainty = {};     // one a pair, or none: what is most certain changes last
    std::span<const std::int8_t> given = {};   // one direction a pair, or none: what all orders hold (0: open)
};

// Streams all crossing orders of a traffic, one int8 a pair: +1 yielder first, -1 prioritized first, 0 left to
// the gap decision. Each order comes once; those that keep most pairs as in `preferred` tend to come first.
class Orders {
  public:
    Orders(const Map& map, const Traffic& traffic, std::span<const Pair> pairs, const OrderSearch& search);

    std::size_t pair_count() const { return pairs_.size(); }

    // Writes up to `most` further orders, (order, pair); returns how many.
    std::size_t next(std::int8_t* out, std::size_t most);

    // How many are still to come, counted up to `most`; nothing is consumed.
    std::size_t count_remaining(std::size_t most) const;

  private:
    struct Choice { // a pair that could go either way, and has not gone the other way yet
        std::size_t depth = 0;
        Precedence before{0};
    };
    void settle(std::size_t pair, std::int8_t direction);
    bool advance(); // to the next order; false if there is none
    bool complete_into(std::int8_t* out) const;
    void orient(std::size_t depth, std::int8_t direction);

    std::vector<Pair> pairs_;
    std::vector<std::size_t> open_;   // indices of the pairs with a choice
    std::vector<std::size_t> follow_; // and of those that go as the others imply, or not at all
    std::vector<std::int8_t> preferred_, order_;
    std::vector<std::uint8_t> committed_, passed_; // passed_: see Completion
    std::vector<Choice> choices_;                  // the first `made_` ones are those made
    std::size_t made_ = 0;
    Precedence precedence_;
    bool started_ = false, finished_ = false;
};

// Completes assignments for one traffic, again and again.
class Completion {
  public:
    // The pairs must outlive their use here. Allocates only where no earlier traffic was as large.
    void prepare(const Map& map, const Traffic& traffic, std::span<const Pair> pairs);

    // Fills in what the assignments (pair,) imply under lane order and transitivity, in place.
    // Throws std::invalid_argument where they contradict each other, the lane order, or what a vehicle can still do;
    // the message holds the vehicles' indices as "vehicle 3".
    void complete(std::span<std::int8_t> assignments) const;

  private:
    std::span<const Pair> pairs_;
    std::vector<Pair> order_;
    Precedence lanes_{0};
    std::vector<std::uint8_t> committed_;
    std::vector<std::uint8_t> passed_; // (pair,): the yielder's centre has left, so nobody need wait for it
};

} // namespace intersection_env
