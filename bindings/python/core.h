// What every generated function of forceserver._core is made of.
#pragma once

#include <pthread.h>

#include <forceserver/driver.h>

#include "core/waits.h"

namespace forceserver_python {

// Each of them stands in a generated file of its own.
void add_functions(py::module_& module);
void add_scene_functions(py::module_& module);

}  // namespace forceserver_python
