// A map by name, looked up by std::string_view without making a std::string. It is ordered and not a hash table because
// names come from other processes: names chosen to collide would make every look-up scan the whole table.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace fs {

template <class T>
using NameMap = std::map<std::string, T, std::less<>>;

}  // namespace fs
