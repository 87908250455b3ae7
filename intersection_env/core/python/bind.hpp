// What the module consists of; the order of these calls is that of the stub.
#pragma once

#include <nanobind/nanobind.h>

namespace intersection_env::python {

void bind_model(nanobind::module_& m);      // maps and traffic
void bind_prediction(nanobind::module_& m); // crossing orders, policies, the predictor
void bind_worlds(nanobind::module_& m);     // closed loop and replay

} // namespace intersection_env::python
