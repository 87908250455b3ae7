#include "worlds/autoreset.hpp"

#include <stdexcept>
#include <string>

namespace intersection_env {

Autoreset autoreset_named(std::string_view name) {
    if (name == "off") {
        return Autoreset::off;
    }
    if (name == "same_step") {
        return Autoreset::same_step;
    }
    if (name == "next_step") {
        return Autoreset::next_step;
    }
    throw std::invalid_argument("autoreset is \"" + std::string(name) + "\"; wanted off, same_step or next_step");
}

} // namespace intersection_env
