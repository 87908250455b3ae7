// NumPy arrays: taken without conversion, made for the core to fill, or views of what it keeps.
#pragma once

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

namespace intersection_env::python {

namespace nb = nanobind;

template <class T>
using Vector = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Arrays = nb::typed<nb::dict, nb::str, nb::any>; // by name

template <class T>
using Matrix = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

using Shape = std::vector<std::size_t>;

// A NumPy array of its own memory, for the core to fill.
template <class T>
nb::ndarray<nb::numpy, T> make(const Shape& shape) {
    std::size_t size = 1;
    for (const std::size_t n : shape) {
        size *= n;
    }
    T* data = new T[size]();
    const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner);
}

// The same, of values that the core has given.
template <class T>
nb::ndarray<nb::numpy, T> copied(const std::vector<T>& values, const Shape& shape) {
    auto array = make<T>(shape);
    std::ranges::copy(values, array.data());
    return array;
}

template <class T>
std::vector<T> copy(const Vector<T>& values) {
    return {values.data(), values.data() + values.size()};
}

// A view of memory that its owner, a bound object, keeps; flags are shown as such.
template <class Stored, class Allocator>
auto view(nb::handle owner, std::vector<Stored, Allocator>& values, const Shape& shape) {
    using Shown = std::conditional_t<std::is_same_v<Stored, std::uint8_t>, bool, Stored>;
    return nb::ndarray<nb::numpy, Shown>(reinterpret_cast<Shown*>(values.data()), shape.size(), shape.data(), owner);
}

// One array of many, by name; its size is checked by whoever is given the values.
template <class T>
nb::ndarray<const T, nb::c_contig, nb::device::cpu> taken(const Arrays& arrays, const char* name) {
    nb::ndarray<const T, nb::c_contig, nb::device::cpu> array;
    if (!arrays.contains(name) || !nb::try_cast(arrays[name], array, false)) {
        throw std::invalid_argument(std::string("the array \"") + name +
                                    "\" is missing, of another type or not contiguous");
    }
    return array;
}

} // namespace intersection_env::python
