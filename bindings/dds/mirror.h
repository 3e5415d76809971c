// The device of a site that has none: it shows the hand of another site. Forces go nowhere.
#pragma once

#include <string>

#include <forceserver/driver.h>

#include "room.h"

namespace bridge {

// Adds the driver "mirror"; once.
void register_mirror();

// What the mirror shows from now on; the bridge's thread.
void show_device(const std::string& site, const forceserver_Status& status, double hand_rate);
void show_hand(const forceserver_Hand& hand, double arrived);  // s, monotonic clock
void show_no_hand();                                           // the site is lost

}  // namespace bridge
