// A life of a device in which all that can go wrong does so, at random and several at once.
#pragma once

#include <algorithm>
#include <cstdio>
#include <functional>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "device/makers/handle.h"
#include "device/makers/rig.h"

namespace makers {

struct Trouble {
  const char* name;
  std::function<void()> begin;
  std::function<void()> mend = nullptr;  // null: it mends by itself
  bool ends_force = true;                // if it lasts
};

// N, of the 3 N at which the spring pushes. Under a sanitizer a stand-in takes some commands of a ramp late, and several at a time.
constexpr double largest_step = is_sanitized ? 2 : 1;

// A servo pushes the handle. Again and again some of the troubles come, or the program stops its servo, closes the device, or asks it
// something from another thread. When all is well again the force comes back, and never by a step.
inline void live_with(const std::vector<Trouble>& troubles, const std::string& uri, Handle& handle) {
  std::mt19937 random(does_all() ? static_cast<unsigned>(getpid()) : 1);
  const auto below = [&](size_t bound) { return std::uniform_int_distribution<size_t>(0, bound - 1)(random); };
  const auto pause = [&](size_t most) { std::this_thread::sleep_for(std::chrono::milliseconds(below(most))); };
  std::optional<Device> device;
  std::optional<Pushing> pushing;
  std::vector<const Trouble*> order;
  for (const Trouble& trouble : troubles) order.push_back(&trouble);
  const auto is_ready_to_push = [&] {
    fs_state hand{};
    fs_scene_get_hand(pushing->scene.get(), &hand, nullptr, nullptr);
    return (hand.flags & FS_STATE_READY) != 0;
  };
  const auto open = [&] {
    if (device) return;
    fs_device* opened = nullptr;
    if (!until([&] { return fs_device_open(uri.c_str(), &opened) == FS_OK; })) ck_abort_msg("%s", fs_last_error());
    device.emplace(opened);
  };
  std::string story;
  for (int round = 0; round < (does_all() ? 60 : 12); ++round) {
    open();
    if (!pushing) pushing.emplace(*device);
    pause(80);
    std::shuffle(order.begin(), order.end(), random);
    const std::span now(order.data(), 1 + below(3));
    story.clear();
    for (const Trouble* trouble : now) {
      story += std::string(story.empty() ? "" : ", ") + trouble->name;
      trouble->begin();
      pause(30);
    }
    std::thread asks([&, asked = below(3)] {
      fs_answer answer;
      fs_state state;
      const fs_wrench wrench{{3, 3, 3}, {}};
      for (size_t i = 0; i < asked; ++i) {
        fs_device_control(device->get(), "status", &answer);
        fs_device_read(device->get(), &state);
        fs_device_write(device->get(), &wrench);  // refused, as a servo has the device
      }
    });
    pause(60);
    // What lasts so short that no driver sees it ends in a step: it asks its device for the status only now and then.
    const bool is_seen = std::any_of(now.begin(), now.end(), [](const Trouble* each) { return each->mend && each->ends_force; });
    ck_assert_msg(!is_seen || until([&] { return !is_ready_to_push(); }), "%s: not seen", story.c_str());
    asks.join();
    const size_t change = below(6);
    if (change < 2) pushing.reset();
    if (change == 1) device.reset();
    story += change == 0 ? ", the servo stops" : change == 1 ? ", the device is closed" : "";
    for (const Trouble* trouble : now) {
      if (trouble->mend) trouble->mend();
      pause(10);
    }
    open();
    if (!pushing) pushing.emplace(*device);
    // Ready, too: a force may be left from before, where the connection was lost and the device has no watchdog.
    const bool is_well = until([&] { return is_ready_to_push() && norm(handle.force()) > 2; });
    fs_answer answer{};
    fs_device_control(device->get(), "status", &answer);
    ck_assert_msg(is_well, "after %s: no force, %s", story.c_str(), answer.text);
    ck_assert_msg(handle.largest_rise() < largest_step, "after %s: a step of %g N", story.c_str(), handle.largest_rise());
  }
  pushing.reset();
  device.reset();
  ck_assert(until([&] { return norm(handle.force()) == 0; }));
  ck_assert_uint_eq(handle.calls_of_servo(), 0);
  std::printf("  the largest rise of a force: %.3f N\n", handle.largest_rise());
}

}  // namespace makers
