#include "say.h"

#include <cstdio>

namespace bridge {
namespace {

void print(FILE* file, const char* before, std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  std::fprintf(file, "%s%s\n", before, text.c_str());
  std::fflush(file);
}

}  // namespace

void say(const std::string& text) { print(stdout, "", text); }
void complain(const std::string& text) { print(stderr, "forceserver-bridge: ", text); }

}  // namespace bridge
