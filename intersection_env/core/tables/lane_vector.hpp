// Memory that lanes may be loaded from and stored to.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace intersection_env {

template <class T>
struct LaneAllocator {
    using value_type = T;
    LaneAllocator() = default;
    template <class U>
    LaneAllocator(const LaneAllocator<U>&) {}
    T* allocate(std::size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), std::align_val_t{64})); }
    void deallocate(T* memory, std::size_t) { ::operator delete(memory, std::align_val_t{64}); }
    bool operator==(const LaneAllocator&) const { return true; }
};

template <class T>
using LaneVector = std::vector<T, LaneAllocator<T>>;

} // namespace intersection_env
