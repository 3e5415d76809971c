// A Falcon that is unplugged, while it is opened and while it pushes the hand; that comes back; that is another one; two at once.
#include <cmath>
#include <vector>

#include "device/usb/falcon_rig.h"

using namespace scenes;

namespace {

// Opens the device while it is unplugged; any status but OK, or a device that is lost at once, is right; then it is there again.
void unplug_while_opening(UsbMoment moment, uint64_t count, Unplug how) {
  FalconRig rig;
  rig.bus.unplug_at(1, moment, count, how);
  fs_device* raw = nullptr;
  const fs_status status = fs_device_open("falcon:0", &raw);
  if (status == FS_OK) {
    const Device device(raw);
    ck_assert(until([&] { return !rig.bus.is_plugged(1); }));
    fs_state state{};
    ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_ERROR_DISCONNECTED; }));
  } else {
    ck_assert_msg(status == FS_ERROR_DISCONNECTED || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_IO, "%s: %s",
                  fs_status_name(status), fs_last_error());
    if (how == Unplug::in_flight && count < 3) std::printf("  %s\n", fs_last_error());
  }
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  rig.bus.plug(1, rig.falcon);
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return is_ready(device.get()); }));
}

}  // namespace

START_TEST(unplugged_while_it_is_opened) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    unplug_while_opening(UsbMoment::open, 1, how);
    unplug_while_opening(UsbMoment::claim, 1, how);
  }
}
END_TEST
START_TEST(unplugged_while_it_is_set_up) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    for (uint64_t i = 1; i <= 6; ++i) unplug_while_opening(UsbMoment::control, i, how);
    for (uint64_t i = 1; i <= 3; ++i) unplug_while_opening(UsbMoment::out, i, how);
    for (uint64_t i = 1; i <= 4; ++i) unplug_while_opening(UsbMoment::in, i, how);
  }
}
END_TEST

// While somebody homes it.
START_TEST(unplugged_while_it_is_homed) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    FalconRig rig;
    rig.change([](FalconModel& model) { model.is_homed = model.homes_when_asked = false; });
    const Device device = open_device("falcon:0");
    Pushing pushing(device.get(), {0.01, 0, 0});
    ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.lights; }) == 1 + 2; }));
    rig.bus.unplug(1, how);
    ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
    ck_assert_int_eq(rig.see([](FalconModel& model) { return model.most_motor; }), 0);
    rig.change([](FalconModel& model) { model.homes_when_asked = true; });
    rig.bus.plug(1, rig.falcon);
    ck_assert(until([&] { return pushes(rig); }));
  }
}
END_TEST

// While it pushes; the same device comes back in the same handle.
START_TEST(unplugged_while_it_pushes) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  const auto recover = [&](const char* what) {
    ck_assert(until([&] { return !rig.bus.is_plugged(1) && pushing.event_with("lost"); }));
    ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
    const double begin = now_s();
    rig.change([](FalconModel& model) { model.rest(); });
    rig.bus.plug(1, rig.falcon);
    ck_assert(until([&] { return pushes(rig); }));
    std::printf("  %s: pushes again %.2f s after it was plugged in\n", what, now_s() - begin);
  };
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    for (const UsbMoment moment : {UsbMoment::in, UsbMoment::out}) {
      for (const uint64_t count : {1, 2}) {
        ck_assert(until([&] { return pushes(rig); }));
        rig.bus.unplug_at(1, moment, count, how);
        recover(moment == UsbMoment::in ? "a report" : "a command");
      }
    }
    ck_assert(until([&] { return pushes(rig); }));
    rig.bus.unplug(1, how);
    recover("at any moment");
  }
}
END_TEST

START_TEST(another_one_is_refused) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  rig.bus.unplug(1, Unplug::in_flight);
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  const uint64_t opens = rig.bus.counts(1).opens;
  const auto other = FalconRig::made("B2");
  rig.bus.plug(1, other);
  // It was opened and closed; each new reason why the device does not come back gives an event.
  ck_assert(until([&] { return rig.bus.counts(1).opens > opens && rig.bus.counts(1).open_now == 0; }));
  ck_assert(until([&] { return rig.bus.counts(1).opens > opens + 1; }));
  ck_assert(pushing.event_with("another device is there: Novint Falcon, serial number 'B2'"));
  rig.bus.with_models([&] { ck_assert_int_eq(other->most_motor, 0); });
  rig.bus.unplug(1, Unplug::between);
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  rig.change([](FalconModel& model) { model.rest(); });
  rig.bus.plug(1, rig.falcon);
  ck_assert(until([&] { return pushes(rig); }));
}
END_TEST

START_TEST(two_at_once) {
  FalconRig rig;
  const auto other = FalconRig::made("B2");
  rig.bus.plug(2, other);
  const Device one = open_device("falcon:A1"), two = open_device("falcon:1");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(two.get(), &info));
  ck_assert_str_eq(info.serial, "B2");
  Pushing right(one.get(), {0.01, 0, 0}), up(two.get(), {0, 0, 0.01});
  const auto force_of_other = [&] {
    fs_vec3 force{};
    rig.bus.with_models([&] { force = other->force(); });
    return force;
  };
  const auto both_push = [&] {
    const fs_vec3 first = rig.see([](FalconModel& model) { return model.force(); }), second = force_of_other();
    return first.x > 0.5 && std::fabs(first.y) < 0.2 && second.y > 0.5 && std::fabs(second.x) < 0.2;
  };
  ck_assert(until(both_push));
  rig.bus.unplug(1, Unplug::in_flight);
  ck_assert(until([&] { return right.event_with("lost"); }));
  uint64_t before = 0;
  rig.bus.with_models([&] { before = other->commands; });
  ck_assert(until([&] {
    uint64_t commands = 0;
    rig.bus.with_models([&] { commands = other->commands; });
    return commands > before + 100;
  }));
  ck_assert(until([&] { return force_of_other().y > 0.5; }));
  rig.change([](FalconModel& model) { model.rest(); });
  rig.bus.plug(1, rig.falcon);
  ck_assert(until(both_push));
}
END_TEST

// What is cancelled does not come back: the device is closed all the same, within some seconds.
START_TEST(a_close_that_hangs) {
  FalconRig rig;
  UsbFaults faults;
  {
    const Device device = open_device("falcon:0");
    ck_assert(until([&] { return is_ready(device.get()); }));
    faults.in = UsbFault::silence;
    faults.is_stuck = true;
    rig.bus.set(1, faults);
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));  // a driver's thread that was left behind on a busy machine ends before the bus
}
END_TEST

// A process that is killed sends nothing any more: the Falcon's own watchdog ends its force.
START_TEST(reports_are_asked_for_while_nobody_has_a_servo) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  const uint64_t before = rig.see([](FalconModel& model) { return model.commands; });
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.commands; }) > before + 100; }));
}
END_TEST

int main() {
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  Suite* suite = suite_create("usb_falcon_unplugged");
  add_case(suite, "unplugged",
           {unplugged_while_it_is_opened, unplugged_while_it_is_set_up, unplugged_while_it_is_homed, unplugged_while_it_pushes,
             another_one_is_refused, two_at_once,
            a_close_that_hangs, reports_are_asked_for_while_nobody_has_a_servo});
  return run_suite(suite);
}
