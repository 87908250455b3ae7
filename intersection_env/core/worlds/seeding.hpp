// The random streams of a world, from a seed: SplitMix64 (Steele, Lea, Flood).
#pragma once

#include <array>
#include <cstdint>

namespace intersection_env {

// Two streams of four words: the world's own, and that of actions sampled in it.
inline std::array<std::uint32_t, 8> random_stream(std::uint64_t seed, std::uint64_t world) {
    const auto mixed = [](std::uint64_t z) {
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        return z ^ (z >> 31);
    };
    std::uint64_t state = mixed(seed + 0x9e3779b97f4a7c15ULL) ^ mixed(world * 0xd1342543de82ef95ULL + 1);
    std::array<std::uint32_t, 8> words{};
    for (std::size_t k = 0; k < 4; ++k) {
        state += 0x9e3779b97f4a7c15ULL;
        const std::uint64_t z = mixed(state);
        words[2 * k] = static_cast<std::uint32_t>(z);
        words[2 * k + 1] = static_cast<std::uint32_t>(z >> 32) | 1U; // never all zero
    }
    return words;
}

} // namespace intersection_env
