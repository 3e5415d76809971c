#include "stability.h"
namespace stability { void write_maps(const std::string&) {} }
