// A wall that is pushed: a direct loop, without the library, with friction and encoder.
#pragma once

#include "measure.h"
#include "plant/plant.h"

namespace stability {

// The motion of the nominal hand, which begins at the wall and whose target is 32 mm behind it: a push of about 4 N.
Oscillation pushed_wall(const DeviceModel& device, double stiffness);

// The longest delay (s) at which such a wall does not oscillate, 50 ms at most.
double critical_delay(double stiffness, double friction);

}  // namespace stability
