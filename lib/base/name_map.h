// A map by name, looked up by std::string_view without making a std::string. Ordered: names come from other processes, and
// names chosen to meet in a hash table would make every look-up as long as the table.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace fs {

template <class T>
using NameMap = std::map<std::string, T, std::less<>>;

}  // namespace fs
