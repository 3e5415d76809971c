// The addresses of devices and their options, as drivers read them.
#include <cmath>
#include <cstring>
#include <functional>
#include <string>

#include "api/support.h"
#include "device/support/address.h"
#include "device/support/refusal.h"

using fs::Address;

static void expect_refusal(const char* part, const std::function<void()>& f) {
  EXPECT(FS_ERROR_INVALID, fs::answer_of(f));
  if (!std::strstr(fs_last_error(), part)) ck_abort_msg("'%s' does not contain '%s'", fs_last_error(), part);
}

START_TEST(parts) {
  const Address address("udp:HOST:7001?a=1&b=x=y?z&c=", {"a", "b", "c", "d"});
  ck_assert_str_eq(address.place().c_str(), "udp:HOST:7001");
  ck_assert(address.text("b") == "x=y?z");
  expect_refusal("option 'c' is empty", [&] { address.text("c"); });
  ck_assert(address.has("c") && !address.has("d") && !address.text("d"));
  ck_assert(!Address("?", {}).has(""));
  const Address other("0?path=c:d", {"path"});
  ck_assert_str_eq(other.place().c_str(), "0");
  expect_refusal("'b' must be key=value", [] { Address("?a=1&b", {"a"}); });
  expect_refusal("'' must be key=value", [] { Address("?a=1&", {"a"}); });
  expect_refusal("'=1' must be key=value", [] { Address("?=1", {}); });
  expect_refusal("'a' is given twice", [] { Address("?a=1&a=1", {"a"}); });
  expect_refusal("'c' is unknown; the options are a, b", [] { Address("?c=1", {"a", "b"}); });
  expect_refusal("'c' is unknown; there are no options", [] { Address("?c=1", {}); });
}
END_TEST

static Address with(const std::string& value) { return Address("?k=" + value, {"k"}); }

START_TEST(values) {
  ck_assert_double_eq(*with("-1.5e-3").number("k", -1, 1), -1.5e-3);
  ck_assert(!with("1").number("other", -1, 1));
  for (const char* bad : {"", " 1", "1 ", "1,5", "x", "nan", "inf", "1e400", "2.1", "0x1", "+1"}) {
    expect_refusal("must be a number within -1..2", [&] { with(bad).number("k", -1, 2); });
  }
  ck_assert_uint_eq(*with("12").whole("k", 0, 20), 12);
  for (const char* bad : {"", "-1", "1.5", "x", "21", "99999999999999999999999", "1 "}) {
    expect_refusal("must be a whole number within 0..20", [&] { with(bad).whole("k", 0, 20); });
  }
  const auto v = *with("1,-2,.5").vector("k", -2, 2);
  ck_assert(v[0] == 1 && v[1] == -2 && v[2] == 0.5);
  for (const char* bad : {"", "1", "1,2", "1,2,", "1,2,3", "1,2,2,2", "1,nan,2", "1, 2,2"}) {
    expect_refusal("k is", [&] { with(bad).vector("k", -2, 2); });
  }
  ck_assert_uint_eq(*with("b").choice("k", {"a", "b"}), 1);
  expect_refusal("k is 'c', must be one of a, b", [] { with("c").choice("k", {"a", "b"}); });
  // Of a long text only the beginning is quoted, of whole characters, so that the sentence has its end.
  std::string snowmen;
  for (int i = 0; i < 2000; ++i) snowmen += "\u2603";
  expect_refusal("\u2603...', must be one of a, b", [&] { with(snowmen).choice("k", {"a", "b"}); });
  expect_refusal("\u2603...' is unknown; the options are k", [&] { Address("?" + snowmen + "=1", {"k"}); });
}
END_TEST

int main() {
  Suite* const suite = suite_create("address");
  TCase* const all = tcase_create("all");
  tcase_add_test(all, parts);
  tcase_add_test(all, values);
  suite_add_tcase(suite, all);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
