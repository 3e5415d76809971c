// Drivers that are modules: in the folder beside the library, loaded when their scheme is first used. The program makes such
// a folder with a copy of the library, and runs itself with that one.
#include <dlfcn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <vector>

#include <forceserver/driver.h>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;

static std::string library(const char* name) { return std::string(DRIVER_FOLDER "/lib") + name + ".so"; }
static std::string modules() { return std::string(std::getenv("MODULE_FOLDER")); }

static bool is_loaded(const char* scheme) { return dlopen((modules() + "/" + scheme + ".so").c_str(), RTLD_NOW | RTLD_NOLOAD); }

START_TEST(a_module_is_loaded_at_its_first_use) {
  const Device sim = open_device("sim:");
  ck_assert(!is_loaded("library"));
  const Device device = open_device("library:0");
  ck_assert(is_loaded("library") && !is_loaded("unloadable"));
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("library:1", &raw), "there is device 0 only");
  EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_driver_load(library("driver_good").c_str()), "library");
}
END_TEST

START_TEST(a_driver_that_was_loaded_before_comes_first) {
  OK(fs_driver_load(library("driver_good").c_str()));
  const Device device = open_device("library:0");
  ck_assert(!is_loaded("library"));
}
END_TEST

START_TEST(what_cannot_be_loaded_says_why) {
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("unloadable:0", &raw), "a_function_that_nobody_has");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("entryless:0", &raw), "fs_driver_entry");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("text:0", &raw), "text.so' cannot be loaded: file too short");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("folder:0", &raw), "is not a file");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("misnamed:0", &raw), "a module has the name of its scheme");
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_device_open("newer:0", &raw), "fs_driver has a field");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("../misnamed:0", &raw), "../misnamed");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("nobody:0", &raw), "the drivers are: entryless, folder, library, ");
  const Device device = open_device("library:0");  // the others do not matter to it
}
END_TEST

START_TEST(all_are_listed) {
  size_t count = 0;
  OK(fs_driver_list(nullptr, 0, &count));
  std::vector<fs_driver_info> all(count);
  OK(fs_driver_list(all.data(), all.size(), &count));
  ck_assert_uint_eq(count, all.size());
  std::string text;
  for (const fs_driver_info& each : all) {
    text += std::string(each.scheme) + (*each.trouble ? "! " : " ");
    std::printf("  %s: %s\n", each.scheme, *each.trouble ? each.trouble : each.path);
    const std::string path = std::strcmp(each.scheme, "sim") ? modules() + "/" + each.scheme + ".so" : "";
    ck_assert_str_eq(each.path, path.c_str());
  }
  ck_assert_str_eq(text.c_str(), "entryless! folder! library misnamed! newer! sim text! unloadable! ");
}
END_TEST

// The library is the copy, which finds the modules beside it.
static int run_with_modules(const char* program) {
  const Folder folder;
  Dl_info info{};
  dladdr(reinterpret_cast<void*>(&fs_version), &info);
  std::filesystem::copy_file(info.dli_fname, folder / std::filesystem::path(info.dli_fname).filename().string());
  const std::string modules = folder / "forceserver/drivers-1";
  std::filesystem::create_directories(modules + "/folder.so");
  const std::pair<const char*, const char*> copies[]{{"driver_good", "library"}, {"driver_good", "misnamed"}, {"driver_without_entry", "entryless"},
                                                     {"driver_newer", "newer"}, {"driver_unloadable", "unloadable"}};
  for (const auto& [from, to] : copies) std::filesystem::copy_file(library(from), modules + "/" + to + ".so");
  std::ofstream(modules + "/text.so") << "this is no library\n";
  // These can never be used, and are not listed.
  std::ofstream(modules + "/README") << "nor is this\n";
  std::filesystem::copy_file(library("driver_good"), modules + "/No_Scheme.so");
  std::filesystem::create_symlink(modules + "/gone", modules + "/dangling.so");
  setenv("LD_LIBRARY_PATH", folder.path.c_str(), 1);
  setenv("MODULE_FOLDER", std::filesystem::canonical(modules).c_str(), 1);
  const pid_t child = fork();
  if (child == 0) {
    execl(program, program, "with modules", nullptr);
    _exit(127);
  }
  int status = 1;
  waitpid(child, &status, 0);
  return status != 0;
}

int main(int count, char** arguments) {
  if (count == 1) return run_with_modules(arguments[0]);
  Suite* suite = suite_create("modules");
  add_case(suite, "modules", {a_module_is_loaded_at_its_first_use, a_driver_that_was_loaded_before_comes_first,
                              what_cannot_be_loaded_says_why, all_are_listed});  // each in a process of its own
  return run_suite(suite);
}
