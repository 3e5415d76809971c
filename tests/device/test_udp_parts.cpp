// The parts of fidel:udp: the bytes of the protocol, the count of what comes, the map of a clock, the meter of a link.
#include <algorithm>
#include <vector>

#include "api/support.h"
#include "device/fidel/udp/arrivals.h"
#include "device/fidel/udp/clock_map.h"
#include "device/fidel/udp/protocol.h"
#include "scenes/random.h"

using namespace scenes;
using namespace fs::udp;

START_TEST(checksum_is_that_of_the_standard) { ck_assert_uint_eq(checksum("123456789", 9), 0xcbf43926u); }
END_TEST

static State some_state() {
  State out;
  out.time = 0x0102030405060708;
  out.sent = out.time + 5;
  out.command_time = out.time - 7;
  out.command = 17;
  out.came = 15;
  out.ignored = 3;
  out.flags = FS_STATE_READY;
  out.buttons = 2;
  out.grip = 0.5f;
  out.pose = {{0.125, -0.25, 0.5}, {0, 1, 0, 0}};
  out.twist = {{1, 2, 3}, {4, 5, 6}};
  out.applied = {{7, 8, 9}, {10, 11, 12}};
  return out;
}

// As UDP.md says: sizes and offsets in bytes.
START_TEST(bytes_are_where_the_page_says) {
  const Datagram d = encode({Type::state, 0x1122334455667788, 0x01020304}, some_state());
  ck_assert_uint_eq(d.size, 24 + 128 + 4);
  const uint8_t head[]{'F', 'I', 'D', 'L', 1, 4, 156, 0, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11, 4, 3, 2, 1, 0, 0, 0, 0, 8, 7};
  ck_assert_mem_eq(d.bytes, head, sizeof head);
  const auto number_at = [](const Datagram& datagram, size_t offset) {
    float out;
    std::memcpy(&out, datagram.bytes + 24 + offset, sizeof out);
    return static_cast<double>(out);
  };
  ck_assert_uint_eq(d.bytes[24 + 24], 17);  // command
  ck_assert_double_eq(number_at(d, 44), 0.5);
  ck_assert_double_eq(number_at(d, 52), -0.25);
  ck_assert_double_eq(number_at(d, 64), 1);  // x of the orientation
  ck_assert_double_eq(number_at(d, 76), 1);
  ck_assert_double_eq(number_at(d, 100), 7);
  ck_assert_double_eq(number_at(d, 120), 12);
  Command model;
  model.is_model = true;
  model.hold = 0.1f;
  model.force = {{1, 2, 3}, {4, 5, 6}};
  model.dfdx = {11, 12, 13, 12, 22, 23, 13, 23, 33};
  const Datagram m = encode({Type::command, 1, 1}, model);
  ck_assert_uint_eq(m.size, 24 + 112 + 4);
  ck_assert_uint_eq(m.bytes[5], 6);
  ck_assert_double_eq(number_at(m, 8), 1);
  const double diagonal_first[]{11, 22, 33, 12, 13, 23};
  for (size_t i = 0; i < 6; ++i) ck_assert_double_eq(number_at(m, 60 + 4 * i), diagonal_first[i]);
  ck_assert_uint_eq(encode({Type::hello, 1, 1}, Hello{}).size, 24 + 40 + 4);
  ck_assert_uint_eq(encode({Type::welcome, 1, 1}, Welcome{}).size, 24 + 200 + 4);
  ck_assert_uint_eq(encode({Type::busy, 1, 1}, Busy{}).size, 24 + 72 + 4);
  ck_assert_uint_eq(encode({Type::command, 1, 1}, Command{}).size, 24 + 32 + 4);
  ck_assert_uint_eq(encode({Type::request, 1, 1}, Request{}).size, 24 + 256 + 4);
  ck_assert_uint_eq(encode({Type::answer, 1, 1}, Answer{}).size, 24 + 520 + 4);
  ck_assert_uint_eq(encode({Type::bye, 1, 1}, Bye{}).size, 24 + 8 + 4);
}
END_TEST

START_TEST(what_is_written_is_read) {
  const Datagram d = encode({Type::state, 5, 6}, some_state());
  Header header{};
  State out;
  ck_assert(open(d.bytes, d.size, header) == Opened::good && decode(d.bytes, d.size, out));
  ck_assert(header.type == Type::state && header.session == 5 && header.number == 6);
  const Datagram again = encode(header, out);
  ck_assert(again.size == d.size && std::memcmp(again.bytes, d.bytes, d.size) == 0);
  Command model;
  model.is_model = true;
  model.dfdx = {11, 12, 13, 12, 22, 23, 13, 23, 33};
  const Datagram m = encode({Type::model, 5, 6}, model);
  Command back;
  ck_assert(decode(m.bytes, m.size, back) && back.is_model);
  ck_assert_double_eq(back.dfdx.zx, 13);
  ck_assert_double_eq(back.dfdx.zy, 23);
}
END_TEST

// Beyond the largest float a conversion is undefined, so such numbers become the largest one.
START_TEST(large_numbers_are_clamped) {
  State state = some_state();
  state.applied.force = {1e300, -1e300, 1};
  const Datagram d = encode({Type::state, 5, 6}, state);
  Header header{};
  State out;
  ck_assert(open(d.bytes, d.size, header) == Opened::good && decode(d.bytes, d.size, out));
  const double most = static_cast<double>(std::numeric_limits<float>::max());
  ck_assert_double_eq(out.applied.force.x, most);
  ck_assert_double_eq(out.applied.force.y, -most);
  ck_assert_double_eq(out.applied.force.z, 1);
}
END_TEST

// Each bit that is wrong, each length that is not right, and all that is not finite.
START_TEST(damage_is_seen) {
  const Datagram good = encode({Type::state, 5, 6}, some_state());
  Header header{};
  for (size_t bit = 0; bit < 8 * good.size; ++bit) {
    Datagram bad = good;
    bad.bytes[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    ck_assert(open(bad.bytes, bad.size, header) == Opened::garbage);
  }
  for (size_t size = 0; size < good.size; ++size) ck_assert(open(good.bytes, size, header) == Opened::garbage);
  State out;
  for (const double wrong : {std::nan(""), HUGE_VAL}) {
    State state = some_state();
    state.pose.position.y = wrong;
    const Datagram d = encode({Type::state, 5, 6}, state);
    ck_assert(open(d.bytes, d.size, header) == Opened::good && !decode(d.bytes, d.size, out));
  }
  State turned = some_state();
  turned.pose.orientation = {0.5, 0, 0, 0};
  const Datagram d = encode({Type::state, 5, 6}, turned);
  ck_assert(!decode(d.bytes, d.size, out));
  Hello hello;  // of another kind
  ck_assert(!decode(good.bytes, good.size, hello));
  Hello loud;
  std::strcpy(loud.name, "a\x1b[2Jb");
  const Datagram said = encode({Type::hello, 1, 1}, loud);
  ck_assert(decode(said.bytes, said.size, hello));
  ck_assert_str_eq(hello.name, "a?[2Jb");
  // Random bytes, with a checksum that is right.
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    Datagram noise = good;
    noise.size = 28 + random.below(largest_datagram - 28 + 1);
    for (size_t j = 8; j < noise.size; ++j) noise.bytes[j] = static_cast<uint8_t>(random.bits());
    noise.bytes[5] = static_cast<uint8_t>(random.below(12));
    noise.bytes[6] = static_cast<uint8_t>(noise.size);
    noise.bytes[7] = static_cast<uint8_t>(noise.size >> 8);
    const uint32_t sum = checksum(noise.bytes, noise.size - 4);
    for (size_t j = 0; j < 4; ++j) noise.bytes[noise.size - 4 + j] = static_cast<uint8_t>(sum >> (8 * j));
    if (open(noise.bytes, noise.size, header) != Opened::good) continue;
    Command command;
    Welcome welcome;
    Busy busy;
    Request request;
    Answer answer;
    Bye bye;
    decode(noise.bytes, noise.size, out), decode(noise.bytes, noise.size, hello), decode(noise.bytes, noise.size, command);
    decode(noise.bytes, noise.size, welcome), decode(noise.bytes, noise.size, busy), decode(noise.bytes, noise.size, request);
    decode(noise.bytes, noise.size, answer), decode(noise.bytes, noise.size, bye);
  }
}
END_TEST

START_TEST(each_is_counted_once) {
  Arrivals a;
  ck_assert(a.note(0xfffffffe) == Arrivals::newest);
  ck_assert(a.note(0xfffffffe) == Arrivals::again);
  ck_assert(a.note(1) == Arrivals::newest);  // round
  ck_assert(a.note(0xffffffff) == Arrivals::late);
  ck_assert(a.note(0xffffffff) == Arrivals::again);
  ck_assert(a.note(200) == Arrivals::newest);
  ck_assert(a.note(1) == Arrivals::again);  // too long ago to be known
  ck_assert(a.note(137) == Arrivals::late);
  ck_assert(a.note(137) == Arrivals::again);
  ck_assert_uint_eq(a.count(), 5);
}
END_TEST

// A link of 20 ms and up to 5 ms more each way, and a clock that runs 100 ppm faster.
START_TEST(a_clock_is_mapped) {
  Random random(11);
  ClockMap map;
  const double ahead = 12345.678, drift = 1e-4;
  double worst = 0;
  const auto controller_time = [&](double host) { return static_cast<uint64_t>(1e9 * (ahead + host * (1 + drift))); };
  for (int i = 0; i < 10000; ++i) {
    const double sent = 100 + 2e-3 * i, up = 0.02 + random.between(0, 0.005), down = 0.02 + random.between(0, 0.005);
    map.note(controller_time(sent), sent + up, up + down);
    const double error = map.to_host(controller_time(sent), sent + up) - sent;
    if (i > 1000) worst = std::fmax(worst, std::fabs(error));
  }
  std::printf("  20 to 25 ms each way, 100 ppm: the time of a state is wrong by at most %.3f ms; round trip %.1f ms\n", 1e3 * worst,
              1e3 * map.round_trip());
  ck_assert_double_lt(worst, 1e-3);
  EXPECT_NEAR(map.round_trip(), 0.04, 1e-3);
  ck_assert_uint_eq(map.jumps(), 0);
}
END_TEST

START_TEST(jumps_of_a_clock_are_found) {
  for (const double jump : {3600.0, -3600.0, 0.05, -0.05, 0.3, -0.3}) {
    Random random(12);
    ClockMap map;
    double worst = 0, worst_last = 0;
    for (int i = 0; i < 4000; ++i) {
      const double sent = 100 + 2e-3 * i, up = 0.003 + random.between(0, 0.001), down = 0.003 + random.between(0, 0.001);
      const auto time = static_cast<uint64_t>(1e9 * (sent + 5000 + (i >= 2000 ? jump : 0)));
      // The round trip of the state after the jump is that long, or negative.
      map.note(time, sent + up, up + down - (i == 2000 ? jump : 0));
      const double error = std::fabs(map.to_host(time, sent + up) - sent);
      if (i > 500) worst = std::fmax(worst, i < 2000 || i > 2004 ? error : 0);
      if (i > 3500) worst_last = std::fmax(worst_last, error);
      ck_assert_double_le(map.to_host(time, sent + up), sent + up);
    }
    std::printf("  a jump of %g s: found %u, then wrong by at most %.3f ms, at the end %.3f ms\n", jump, map.jumps(), 1e3 * worst,
                1e3 * worst_last);
    ck_assert_uint_ge(map.jumps(), 1);
    ck_assert_double_lt(worst, 5e-3);
    ck_assert_double_lt(worst_last, 1e-3);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("udp_parts");
  for (const TTest* test : {checksum_is_that_of_the_standard, bytes_are_where_the_page_says, what_is_written_is_read, large_numbers_are_clamped,
                            damage_is_seen, each_is_counted_once, a_clock_is_mapped, jumps_of_a_clock_are_found}) {
    add_case(suite, test->name, {test});  // CK_RUN_CASE selects one
  }
  return run_suite(suite);
}
