// A test case whose tests leave nothing behind: no process, no descriptor, no mapping of the library's memory, no file;
// and, as everywhere, no socket and no thread.
#pragma once

#include <sys/wait.h>

#include <cerrno>

#include "api/world.h"
#include "ipc/process.h"

namespace life {

inline size_t descriptors_before;
inline void look_before() { descriptors_before = descriptors().size(); }
inline void look_after() {
  Holdings after;
  ck_assert_msg(scenes::eventually([&] {
    after = holdings();
    return after.descriptors == descriptors_before && after.mappings == 0;
  }), "%zu descriptors before; after: %s", descriptors_before, to_text(after).c_str());
  ck_assert(waitpid(-1, nullptr, WNOHANG) == -1 && errno == ECHILD);
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm", none)) {
    ck_assert_msg(entry.path().string().find("forceserver") == std::string::npos, "%s remains", entry.path().c_str());
  }
}

inline TCase* new_case(Suite* suite, const char* name) {
  TCase* test_case = scenes::new_case(suite, name);
  tcase_add_checked_fixture(test_case, look_before, look_after);
  return test_case;
}
inline void add_case(Suite* suite, const char* name, std::initializer_list<const TTest*> tests) {
  TCase* test_case = life::new_case(suite, name);
  for (const TTest* test : tests) tcase_add_test(test_case, test);
}

}  // namespace life
