// What is done alike with all arrays that tables/world_fields.hpp lists.
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "tables/lane_vector.hpp"
#include "tables/world_fields.hpp"

namespace intersection_env {

template <class Number>
using Values = std::vector<Number>;

// Room for so many worlds, all numbers 0.
template <class Arrays>
void make_room(Arrays& arrays, long worlds, int vehicles) {
    Arrays::for_each([&](auto field, auto member) {
        (arrays.*member).resize(static_cast<std::size_t>(worlds * numbers_in_world(field.per, vehicles)));
    });
}

// Where the arrays hold the numbers of the worlds from `first_world` on.
template <class Pointers, class Arrays>
Pointers pointers_into(Arrays& arrays, long first_world, int vehicles) {
    Pointers pointers;
    Pointers::template for_each<Arrays>([&](auto field, auto to, auto from) {
        pointers.*to = (arrays.*from).data() + first_world * numbers_in_world(field.per, vehicles);
    });
    return pointers;
}

// Calls copy(kept, shown) for every number of a state: where the kernel keeps it, and where it stands when worlds lie
// one after the other. place(world, k, count): the kernel's index of the k-th of a world's `count` numbers.
template <class Kept, class Shown, class Place, class Copy>
void for_each_number(Kept& kept, Shown& shown, long worlds, int vehicles, const Place& place, const Copy& copy) {
    using Plain = std::remove_const_t<Kept>;
    Plain::template for_each<std::remove_const_t<Shown>>([&](auto field, auto in_kept, auto in_shown) {
        const long count = numbers_in_world(field.per, vehicles);
        for (long world = 0; world < worlds; ++world) {
            for (long k = 0; k < count; ++k) {
                copy((kept.*in_kept)[static_cast<std::size_t>(place(world, k, count))],
                     (shown.*in_shown)[static_cast<std::size_t>(world * count + k)]);
            }
        }
    });
}

// No step led to where this world is now: there are no flags and no reward.
template <class Buffers>
void forget_step(Buffers& buffers, long world, int vehicles) {
    const auto clear = [world](auto& values, long count) {
        std::fill_n(values.begin() + world * count, count,
                    typename std::remove_reference_t<decltype(values)>::value_type{});
    };
    Buffers::for_each([&](auto field, auto member) {
        if constexpr (std::is_same_v<typename std::remove_cvref_t<decltype(buffers.*member)>::value_type,
                                     std::uint8_t>) {
            clear(buffers.*member, numbers_in_world(field.per, vehicles));
        }
    });
    clear(buffers.reward, vehicles);
}

} // namespace intersection_env
