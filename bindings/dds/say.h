// What the bridge tells people, a line each. Other sites may write anything into a name: control characters are not printed.
#pragma once

#include <string>

namespace bridge {

void say(const std::string& text);       // what happens
void complain(const std::string& text);  // what goes wrong

}  // namespace bridge
