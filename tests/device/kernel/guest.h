// What the tests in the guest share. There they are root, and alone with a udevd.
#pragma once

#include <grp.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <check.h>
#undef fail  // an old macro of Check's; std::ios has a function of that name

namespace scenes {

inline constexpr double long_enough_here = 60;  // s: an emulated machine is slow, and may be on a busy one

// Asks again and again until it is so; false: that took too long.
template <class Condition>
bool until(Condition condition) {
  const auto start = std::chrono::steady_clock::now();
  while (!condition()) {
    if (std::chrono::steady_clock::now() - start > std::chrono::duration<double>(long_enough_here)) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

inline std::string word_in(const std::filesystem::path& path) {
  std::string word;
  std::ifstream(path) >> word;
  return word;
}

// The nodes of the devices that have this serial number, when udevd has done with them.
inline std::vector<std::string> nodes_of(const std::string& serial) {
  if (std::system("udevadm settle") != 0) throw std::runtime_error("udevadm settle fails");
  std::vector<std::string> nodes;
  for (const auto& device : std::filesystem::directory_iterator("/sys/bus/usb/devices")) {
    const std::filesystem::path folder = device.path();
    if (word_in(folder / "serial") != serial) continue;
    char node[64];
    std::snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", std::stoi(word_in(folder / "busnum")), std::stoi(word_in(folder / "devnum")));
    nodes.push_back(node);
  }
  return nodes;
}

// Waits until the device is there.
inline std::string await_node(const std::string& serial) {
  std::vector<std::string> nodes;
  ck_assert_msg(until([&] { return !(nodes = nodes_of(serial)).empty(); }), "no device '%s' comes", serial.c_str());
  return nodes.front();
}

// Runs a test's code in another process as an ordinary user; whether all that it asserted was so.
template <class Function>
bool as_user(Function function) {
  constexpr uid_t user = 1000;
  const pid_t child = fork();
  if (child == 0) {
    const bool is_user = setgroups(0, nullptr) == 0 && setgid(user) == 0 && setuid(user) == 0;
    if (is_user) function();
    _exit(is_user ? 0 : 1);
  }
  int status = 1;
  waitpid(child, &status, 0);
  return status == 0;
}

// Each test runs in a process of its own, with whose end its devices are unplugged.
inline int run_cases(const char* name, std::initializer_list<const TTest*> tests) {
  Suite* suite = suite_create(name);
  for (const TTest* test : tests) {
    TCase* test_case = tcase_create(test->name);  // CK_RUN_CASE chooses one
    tcase_set_timeout(test_case, 4 * long_enough_here);
    tcase_add_test(test_case, test);
    suite_add_tcase(suite, test_case);
  }
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_VERBOSE);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}

}  // namespace scenes
