// The drivers of this process, by URI scheme. Drivers hand in a table of functions; the library includes none of them.
// Any thread, at any time: also from static initialisers and while the process ends.
#pragma once

#include <string>
#include <vector>

#include <forceserver/driver.h>

namespace fs {

// Copies the table and the scheme. Throws INVALID (a missing function, a scheme that is not 1..31 of [a-z0-9]), EXISTS,
// VERSION. list, write_model and advance may be null.
void register_driver(const fs_driver& driver);

// Loads a library and registers the driver that its fs_driver_entry gives. Throws IO, and what register_driver throws.
void load_driver(const char* path);

// Makes a scheme known whose driver is not built in: whoever asks for it is told so.
void announce_scheme(const char* scheme);
bool is_announced(const std::string& scheme);

// Null when there is none of this scheme. Lives as long as the process.
const fs_driver* find_driver(const std::string& scheme);
std::vector<const fs_driver*> all_drivers();  // in order of their schemes

}  // namespace fs
