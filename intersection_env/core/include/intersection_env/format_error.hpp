// What a map or a policy file that cannot be read is refused with.
#pragma once

#include <stdexcept>

namespace intersection_env {

// What a file holds is not what it must hold; the message names file, line, what came and what was wanted.
class FormatError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

} // namespace intersection_env
