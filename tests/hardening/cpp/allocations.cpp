// Prints how often a planner's cycle allocates memory, from the second cycle on: allocations MAP POLICY THREADS.
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <vector>

#include <intersection_env/planner.hpp>

using namespace intersection_env;

namespace {
std::atomic<long> allocations = 0;

void* counted(void* memory) {
    ++allocations;
    return memory != nullptr ? memory : throw std::bad_alloc();
}
} // namespace

void* operator new(std::size_t size) { return counted(std::malloc(size)); }
void* operator new(std::size_t size, std::align_val_t align) {
    const auto to = static_cast<std::size_t>(align);
    return counted(std::aligned_alloc(to, (size + to - 1) / to * to));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

int main(int, char** arguments) {
    const Planner planner(Map::read(arguments[1]), Policy::read(arguments[2]), std::atoi(arguments[3]));
    const std::vector<Vehicle> vehicles{{"SE-NW", 95, 12}, {"NE-SW", 80, 3}, {"NW-NE", 140, 6}, {"SW-NE", 70, 5}};
    Traffic traffic = traffic_of(planner.map(), vehicles);
    const Ranking ranking = planner.rank(traffic);
    std::vector<std::int8_t> priorities; // several blocks, and single scenarios after them
    for (int copy = 0; copy < 10; ++copy) {
        priorities.insert(priorities.end(), ranking.priorities.begin(), ranking.priorities.end());
    }
    Prediction kept;
    planner.predict(traffic, priorities, kept);
    allocations = 0;
    for (int cycle = 0; cycle < 100; ++cycle) {
        traffic.position[0] += 0.01F;
        planner.predict(traffic, priorities, kept);
        planner.predict(traffic, {}, kept);
    }
    std::printf("%ld allocations with %zu scenarios\n", allocations.load(), 10 * ranking.maneuvers.size());
    return 0;
}
