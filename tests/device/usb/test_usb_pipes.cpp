// What drivers share over libusb (device/support/usb_pipes.h), with the model of a Falcon, whose USB chip always has something to say.
#include "device/usb/falcon_rig.h"

#include "device/falcon/firmware.h"
#include "device/falcon/packet.h"
#include "device/support/usb_pipes.h"

using namespace scenes;
using fs::UsbPipes;

namespace {

struct Open {
  uint64_t taken = 0;
  fs::UsbDevice device{fs::falcon::falcon_kind, "0", 0};
  UsbPipes pipes{device, {0x81, 0x02, 64, 16, false}, take, this};

  static void take(void* self, const uint8_t*, size_t) noexcept { ++static_cast<Open*>(self)->taken; }
  fs_status send() {
    const fs::falcon::Packet packet = fs::falcon::packet_of({});
    return pipes.send(packet.data(), packet.size(), 0.003);
  }
  // Calls receive until it gives something else than this status; the status.
  fs_status after(fs_status status) {
    fs_status got = status;
    for (Patience patience; got == status && patience.lasts();) got = pipes.receive(0.02);
    return got;
  }
  // Whether this status comes. Others may come before it, as the machine may be late.
  bool comes_to(fs_status status) {
    for (Patience patience; patience.lasts();) {
      if (pipes.receive(0.02) == status) return true;
    }
    return false;
  }
};

}  // namespace

// Both ways in which it shows: at once, for good, and without anything that is still in flight.
START_TEST(gone_is_disconnected) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    for (const bool is_silent : {false, true}) {
      FalconRig rig;
      Open open;
      ck_assert_int_eq(open.after(FS_ERROR_TIMEOUT), FS_OK);
      if (is_silent) rig.fault(UsbFault::silence);
      rig.bus.unplug(1, how);
      fs_status status = FS_OK;
      for (int i = 0; i < 4 && status != FS_ERROR_DISCONNECTED; ++i) status = open.pipes.receive(0.02);
      ck_assert_int_eq(status, FS_ERROR_DISCONNECTED);
      ck_assert_int_eq(open.pipes.receive(0.02), FS_ERROR_DISCONNECTED);
      ck_assert_int_eq(open.send(), FS_ERROR_DISCONNECTED);
    }
  }
}
END_TEST
START_TEST(gone_shows_in_a_send) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    FalconRig rig;
    Open open;
    rig.bus.unplug_at(1, UsbMoment::out, 1, how);
    fs_status status = FS_OK;
    for (int i = 0; i < 4 && status == FS_OK; ++i) status = open.send();
    ck_assert_int_eq(status, FS_ERROR_DISCONNECTED);
  }
}
END_TEST

START_TEST(faults_of_reports_are_told_and_mended) {
  FalconRig rig;
  Open open;
  ck_assert_int_eq(open.after(FS_ERROR_TIMEOUT), FS_OK);
  for (const UsbFault fault : {UsbFault::stall, UsbFault::error, UsbFault::overlong}) {
    rig.fault(fault);
    ck_assert(open.comes_to(FS_ERROR_IO));
    rig.fault(UsbFault::none);
    ck_assert(open.comes_to(FS_OK));
  }
  ck_assert_uint_gt(rig.bus.counts(1).clears, 0);
  ck_assert(open.pipes.counts().stalls > 0 && open.pipes.counts().errors > 0 && open.pipes.counts().overlong > 0);
  rig.fault(UsbFault::silence);
  ck_assert_int_eq(open.after(FS_OK), FS_ERROR_TIMEOUT);
}
END_TEST

START_TEST(commands_never_pile_up) {
  FalconRig rig;
  Open open;
  rig.fault(UsbFault::none, UsbFault::silence);
  const uint64_t before = rig.bus.counts(1).outs;
  ck_assert_int_eq(open.send(), FS_OK);  // handed over, not taken
  ck_assert_int_eq(open.send(), FS_ERROR_TIMEOUT);
  ck_assert_uint_eq(rig.bus.counts(1).outs, before + 1);
  fs_status status = FS_ERROR_TIMEOUT;
  for (Patience patience; status == FS_ERROR_TIMEOUT && patience.lasts();) status = open.send();
  ck_assert_int_eq(status, FS_ERROR_IO);  // it was withdrawn
  ck_assert_uint_eq(open.pipes.counts().lost, 1);
  rig.fault(UsbFault::none, UsbFault::stall);
  open.send();
  ck_assert_int_eq(open.pipes.flush(1), FS_ERROR_IO);
  rig.fault(UsbFault::none);
  ck_assert(until([&] { return open.send() == FS_OK && open.pipes.flush(1) == FS_OK; }));
}
END_TEST

START_TEST(what_does_not_come_back_holds_up_nobody) {
  FalconRig rig;
  UsbFaults faults;
  faults.in = UsbFault::silence;
  faults.is_stuck = true;
  rig.bus.set(1, faults);
  const double begin = now_s();
  { Open open; }
  ck_assert_double_ge(now_s() - begin, 0.4);  // it waited for it
}
END_TEST

int main() {
  Suite* suite = suite_create("usb_pipes");
  add_case(suite, "pipes", {gone_is_disconnected, gone_shows_in_a_send, faults_of_reports_are_told_and_mended, commands_never_pile_up,
                            what_does_not_come_back_holds_up_nobody});
  return run_suite(suite);
}
