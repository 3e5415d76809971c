// The drivers of this process, by URI scheme. A driver registers a table of functions; lib/ includes no driver.
// Any thread may call these functions at any time, even from static initialisers and while the process ends.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <forceserver/driver.h>

namespace fs {

inline constexpr size_t scheme_length_max = 31;
// Whether a driver can have this name.
bool is_scheme(const std::string& text);

// Copies the table and the scheme. Throws INVALID (a missing function, a scheme that is not 1..31 of [a-z0-9]), EXISTS,
// VERSION. list, write_model, advance, get_link and control may be null.
void register_driver(const fs_driver& driver);

// Loads a library and registers the driver that its fs_driver_entry returns. Throws IO, and as register_driver does.
void load_driver(const char* path);

// A module is the library of a driver that is loaded when its scheme is first used. It is found beside this library:
// FOLDER_OF_THIS_LIBRARY/forceserver/drivers-1/SCHEME.so.
std::string module_folder();

// The table lives as long as the process. Null when no driver has this scheme. Throws what load_driver throws where there is a
// module that cannot be loaded.
const fs_driver* find_driver(const std::string& scheme);
std::vector<const fs_driver*> all_drivers();  // that are registered, in order of their schemes
std::vector<std::string> all_schemes();       // of these and of the modules that are not loaded yet, in order

// Loads all modules, and tells for each driver where it is from, or why it cannot be used.
std::vector<fs_driver_info> list_drivers();

}  // namespace fs
