// NumPy arrays: taken without conversion, made for the core to fill, or views of what it keeps.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
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

// A NumPy array of its own memory, for the core to fill.
template <class T>
nb::ndarray<nb::numpy, T> make(std::vector<std::size_t> shape) {
    std::size_t size = 1;
    for (const std::size_t n : shape) {
        size *= n;
    }
    T* data = new T[size]();
    const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner);
}

template <class T>
std::vector<T> copy(const Vector<T>& values) {
    return {values.data(), values.data() + values.size()};
}

// A view of memory that its owner, a bound object, keeps.
template <class T>
nb::ndarray<nb::numpy, T> view(nb::handle owner, T* data, std::initializer_list<int> shape) {
    std::vector<std::size_t> sizes(shape.begin(), shape.end());
    return nb::ndarray<nb::numpy, T>(data, sizes.size(), sizes.data(), owner);
}

inline nb::ndarray<nb::numpy, bool> flags(nb::handle owner, std::vector<std::uint8_t>& data,
                                          std::initializer_list<int> shape) {
    return view(owner, reinterpret_cast<bool*>(data.data()), shape);
}

template <class T, class Stored>
nb::ndarray<nb::numpy, T> copied(const std::vector<Stored>& values, std::initializer_list<int> shape) {
    auto array = make<T>(std::vector<std::size_t>(shape.begin(), shape.end()));
    std::copy(values.begin(), values.end(), array.data());
    return array;
}

// One array of a state, by name; its size is checked by whoever takes the state.
template <class T, class Stored>
void take(const Arrays& state, const char* name, std::vector<Stored>& values) {
    using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
    Array array;
    if (!state.contains(name) || !nb::try_cast<Array>(state[name], array, false)) {
        throw std::invalid_argument(std::string("the array \"") + name +
                                    "\" is missing, of another type or not contiguous");
    }
    values.assign(array.data(), array.data() + array.size());
}

} // namespace intersection_env::python
