// What every generated function of forceserver._core is made of.
#pragma once

#include <pthread.h>

#include <forceserver/driver.h>

#include "core/waits.h"
