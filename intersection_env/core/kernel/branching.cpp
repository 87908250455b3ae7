// Scenarios that have a beginning in common, which is predicted once.
//
// A branch is a state of the traffic and the scenarios that have come to it; each lane holds one, at a step of its own.
// Where the scenarios of a branch no longer decide alike, it is parted: those of one decision stay in the lane; for
// each other decision a branch is laid on a pile, with the state at the begin of the step, and a lane that is through
// takes it up. Every lane computes what it would compute for each of its scenarios alone, to the same bytes.
#include "kernel/branch_results.hpp"
#include "kernel/branches.hpp"
#include "kernel/kernel.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

constexpr std::uint64_t bit(int vehicle) { return std::uint64_t{1} << vehicle; }

void operator|=(BranchDecision& sum, const BranchDecision& other) {
    sum.waits |= other.waits;
    sum.refused |= other.refused;
    sum.told |= other.told;
}

// What a pair says under each assignment, from -1 on, in the lanes whose scenarios have different ones.
struct Question {
    int pair;
    unsigned lanes; // one bit a lane, here and below
    unsigned refuses_yielder[3], refuses_prioritized[3], tells_yielder[3], tells_prioritized[3], keeps_prioritized[3];
};

struct Choice {
    int pair;
    BranchDecision of[3]; // by assignment, from -1 on

    bool is(const Choice& other) const {
        return pair == other.pair && of[0] == other.of[0] && of[1] == other.of[1] && of[2] == other.of[2];
    }
};

// Choices that all scenarios of a branch have made alike: while they stay what they are, nobody need be asked again.
struct Agreement {
    static constexpr int MOST = 48; // ours: more are made anew
    int count = -1;                 // -1: none
    Choice choices[MOST];
    BranchDecision decision;

    bool covers(const Choice* made, int made_count) const {
        bool same = count == made_count;
        for (int c = 0; same && c < count; ++c) {
            same = choices[c].is(made[c]);
        }
        return same;
    }

    void remember(const Choice* made, int made_count, const BranchDecision& by_all) {
        count = made_count <= MOST ? made_count : -1;
        for (int c = 0; c < count; ++c) {
            choices[c] = made[c];
        }
        decision = by_all;
    }
};

struct BranchingLanes : BranchLanes {
    std::uint64_t heeded; // whose holds somebody asks for; one bit a vehicle
    Question questions[MAX_PAIRS];
    Choice choices[MAX_PAIRS]; // of one lane
    int question_count;
    Agreement agreements[WIDTH];
};

class Branching {
  public:
    Branching(const Problem& problem, const ScenarioArguments& arguments, const BranchMemory& memory,
              BranchingLanes& lanes)
        : problem_(problem), arguments_(arguments), memory_(memory), lanes_(lanes),
          branches_(problem, arguments.assignments, memory, lanes), results_(problem, arguments, memory, lanes) {}

    void run() {
        branches_.begin(arguments_.scenarios);
        for (Agreement& agreement : lanes_.agreements) {
            agreement.count = -1;
        }
        find_heeded();
        while (branches_.fill_lanes()) {
            observe_lanes();
            finish_branches();
            ask_pairs();
            part_branches();
            decide_vehicles(problem_, lanes_);
            drive_lanes();
        }
    }

  private:
    // Where nobody is left unassigned only the decision to enter counts; elsewhere some holds are asked for too, and
    // those of who is ahead of them in a queue. Where holds are stored, all of them count.
    void find_heeded() {
        lanes_.heeded = arguments_.trajectories.hold != nullptr ? ~std::uint64_t{0} : 0;
        for (int p = 0; p < problem_.pair_count; ++p) {
            const ProblemPair& pair = problem_.pairs[p];
            const int assignment = lanes_.assignments[p][0];
            if (assignment == 0 || assignment == DIFFERENT_OR_NONE) {
                lanes_.heeded |= bit(pair.prioritized) | (pair.by_arrival ? bit(pair.yielder) : 0);
            }
        }
        for (std::uint64_t before = ~lanes_.heeded; before != lanes_.heeded;) {
            before = lanes_.heeded;
            for (int i = 0; i < problem_.vehicle_count; ++i) {
                const ProblemVehicle& vehicle = problem_.vehicles[i];
                for (int c = vehicle.first_candidate; (before & bit(i)) != 0 && c < vehicle.last_candidate; ++c) {
                    const LeadCandidate& ahead = problem_.candidates[c];
                    lanes_.heeded |= ahead.same_stop_lane ? bit(ahead.other) : 0;
                }
            }
        }
    }

    void observe_lanes() {
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.waited_before[i] = lanes_.vehicles[i].waited;
        }
        observe_vehicles(problem_, problem_.driver == Driver::network, lanes_);
        if (arguments_.minimum_distance != nullptr) {
            lanes_.distance = smallest_distance(problem_, lanes_, lanes_.distance);
        }
        if (arguments_.followed != nullptr) {
            find_broken();
        }
    }

    void find_broken() {
        const Ints second = all_ints(-1), first = all_ints(1);
        for (int p = 0; p < problem_.pair_count; ++p) {
            const ProblemPair& pair = problem_.pairs[p];
            const Floats beyond = lanes_.vehicles[pair.yielder].front - pair.yielder_entry;
            const Floats foe_beyond = lanes_.vehicles[pair.prioritized].front - pair.prioritized_entry;
            const Ints by_yielder = disobeys(active(pair, second, lanes_), second, beyond, foe_beyond);
            const Ints by_prioritized = disobeys(active(pair, first, lanes_), first, beyond, foe_beyond);
            lanes_.broken[p] |= (by_yielder & FIRST_IS_PRIORITIZED) | (by_prioritized & FIRST_IS_YIELDER);
        }
    }

    // Those at the end of the horizon.
    void finish_branches() {
        for (int l = 0; l < WIDTH; ++l) {
            if (lanes_.busy[l] != 0 && lanes_.branch[l].step == STEPS) {
                results_.store_summary(l);
                branches_.clear(l);
                lanes_.agreements[l].count = -1;
            }
        }
    }

    void ask_pairs() {
        lanes_.question_count = 0;
        for (int p = 0; p < problem_.pair_count; ++p) {
            const Ints assignment = lanes_.assignments[p], different = lanes_.busy & (assignment > 1);
            decide_pair(problem_, problem_.pairs[p], assignment, ~different, lanes_);
            if (any(different)) {
                ask(p, different);
            }
        }
    }

    void ask(int p, Ints different) {
        Question& question = lanes_.questions[lanes_.question_count];
        question.pair = p;
        question.lanes = 0;
        for (int way = -1; way <= 1; ++way) {
            const Ints where = way == 0 ? different & (lanes_.assignments[p] == DIFFERENT_OR_NONE) : different;
            const Answer found = answer(problem_, problem_.pairs[p], all_ints(way), where, lanes_);
            question.refuses_yielder[way + 1] = bits(found.refuses_yielder);
            question.refuses_prioritized[way + 1] = bits(found.refuses_prioritized);
            question.tells_yielder[way + 1] = bits(found.tells_yielder);
            question.tells_prioritized[way + 1] = bits(found.tells_prioritized);
            question.keeps_prioritized[way + 1] = bits(found.keeps_prioritized);
            question.lanes |= bits(found.refuses_yielder | found.refuses_prioritized | found.keeps_prioritized);
        }
        lanes_.question_count += question.lanes != 0 ? 1 : 0;
    }

    void part_branches() {
        unsigned asked = 0;
        for (int q = 0; q < lanes_.question_count; ++q) {
            asked |= lanes_.questions[q].lanes;
        }
        for (; asked != 0; asked &= asked - 1) {
            const int lane = __builtin_ctz(asked), choices = find_choices(lane);
            if (choices > 0) {
                decide_and_part(lane, choices);
            }
        }
    }

    // What the scenarios of the lane's branch choose between; what changes nothing for a vehicle is left out.
    int find_choices(int lane) {
        BranchDecision matters{0, 0, 0}; // what would change something
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            const PredictedVehicle& vehicle = lanes_.vehicles[i];
            const bool refused = vehicle.refused[lane] != 0, waits = refused || vehicle.kept[lane] != 0;
            if (vehicle.refused_by_assignment[lane] == 0 && settled(vehicle)[lane] == 0) {
                matters.waits |= waits ? 0 : bit(i);
                matters.refused |= refused ? 0 : bit(i) & lanes_.heeded;
                matters.told |= bit(i) & lanes_.heeded;
            }
        }
        int count = 0;
        for (int q = 0; q < lanes_.question_count; ++q) {
            const Question& question = lanes_.questions[q];
            if ((question.lanes >> lane & 1) != 0) {
                Choice& choice = lanes_.choices[count];
                choice.pair = question.pair;
                std::uint64_t says = 0;
                for (int way = 0; way < 3; ++way) {
                    const BranchDecision found = decision(question, way, lane, matters);
                    choice.of[way] = found;
                    says |= found.waits | found.refused | found.told;
                }
                count += says != 0 ? 1 : 0;
            }
        }
        return count;
    }

    BranchDecision decision(const Question& question, int way, int lane, const BranchDecision& matters) const {
        const ProblemPair& pair = problem_.pairs[question.pair];
        const auto vehicles = [lane, i = bit(pair.yielder), j = bit(pair.prioritized)](unsigned of_i, unsigned of_j) {
            return ((of_i >> lane & 1) != 0 ? i : 0) | ((of_j >> lane & 1) != 0 ? j : 0);
        };
        const std::uint64_t refused = vehicles(question.refuses_yielder[way], question.refuses_prioritized[way]);
        const std::uint64_t told = vehicles(question.tells_yielder[way], question.tells_prioritized[way]);
        return {(refused | vehicles(0, question.keeps_prioritized[way])) & matters.waits, refused & matters.refused,
                told & matters.told};
    }

    void decide_and_part(int lane, int choices) {
        Agreement& agreement = lanes_.agreements[lane];
        if (!agreement.covers(lanes_.choices, choices)) {
            decide(lane, choices);
            agreement.remember(lanes_.choices, choices, memory_.decisions[lanes_.branch[lane].first]);
            branches_.part(lane);
        }
        const BranchDecision& decision = agreement.decision;
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            PredictedVehicle& vehicle = lanes_.vehicles[i];
            const bool told = (decision.told & bit(i)) != 0, refused = told || (decision.refused & bit(i)) != 0;
            vehicle.refused[lane] |= refused ? -1 : 0;
            vehicle.refused_by_assignment[lane] |= told ? -1 : 0;
            vehicle.kept[lane] |= (decision.waits & bit(i)) != 0 ? -1 : 0;
        }
    }

    // What each scenario of the lane's branch comes to.
    void decide(int lane, int choices) {
        const Branch& branch = lanes_.branch[lane];
        for (int s = branch.first; s < branch.last; ++s) {
            const std::int8_t* assigned = branches_.assignments(s);
            BranchDecision sum{0, 0, 0};
            for (int c = 0; c < choices; ++c) {
                sum |= lanes_.choices[c].of[assigned[lanes_.choices[c].pair] + 1];
            }
            memory_.decisions[s] = sum;
        }
    }

    void drive_lanes() {
        const float inverse_root = inverse_root_of(problem_.idm);
        each_branch([this](int lane) { results_.store_state(lane, lanes_.branch[lane].step); });
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            PredictedVehicle& vehicle = lanes_.vehicles[i];
            const Floats top_speed = all(problem_.vehicles[i].max_speed);
            const Floats wanted = any(vehicle.present) ? drive(problem_, inverse_root, top_speed, vehicle) : all(0.0F);
            lanes_.applied[i] = advance(problem_.vehicles[i], wanted, vehicle);
        }
        each_branch([this](int lane) {
            const int step = lanes_.branch[lane].step++;
            results_.store_action(lane, step);
            if (step == STEPS - 1) {
                results_.store_state(lane, STEPS);
                results_.store_action(lane, STEPS);
            }
        });
    }

    template <class Use>
    void each_branch(Use use) const {
        for (unsigned busy = bits(lanes_.busy); busy != 0; busy &= busy - 1) {
            use(__builtin_ctz(busy));
        }
    }

    const Problem& problem_;
    const ScenarioArguments& arguments_;
    const BranchMemory& memory_;
    BranchingLanes& lanes_;
    Branches branches_;
    const BranchResults results_;
};

} // namespace

void predict_branching(const Problem& problem, const ScenarioArguments& arguments, const BranchMemory& memory,
                       Workspace& workspace) {
    Branching(problem, arguments, memory, reinterpret_cast<BranchingLanes&>(workspace)).run();
}

Workspace* create_branches() { return reinterpret_cast<Workspace*>(new BranchingLanes); }
void destroy_branches(Workspace* workspace) { delete reinterpret_cast<BranchingLanes*>(workspace); }

} // namespace intersection_env::INTERSECTION_ENV_ISA
