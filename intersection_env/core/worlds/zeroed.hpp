// Arrays of zeros whose memory counts as used only from where it is written to on.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

namespace intersection_env {

// For vectors that are resized once: new numbers are the zeros that the system gives.
template <class T>
struct ZeroedAllocator {
    using value_type = T;
    ZeroedAllocator() = default;
    template <class U>
    ZeroedAllocator(const ZeroedAllocator<U>&) {}
    T* allocate(std::size_t count) {
        void* memory = std::calloc(count, sizeof(T));
        return memory != nullptr ? static_cast<T*>(memory) : throw std::bad_alloc();
    }
    void deallocate(T* memory, std::size_t) { std::free(memory); }
    void construct(T*) {}
    bool operator==(const ZeroedAllocator&) const { return true; }
};

template <class T>
using Zeroed = std::vector<T, ZeroedAllocator<T>>;

} // namespace intersection_env
