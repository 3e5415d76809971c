// A maker's library, which is loaded when a device of that maker is first opened, or looked for. It stays loaded until the process
// ends, as it may have threads of its own.
//
// What is wrong is thrown as a Refusal: NOT_FOUND with the words of the system's loader, VERSION where a function is missing.
#pragma once

#include <initializer_list>
#include <string>

namespace fs {

class MakerLibrary {
 public:
  // names: where it may be, tried one after the other: paths, or names that the system's loader looks for. wanted: what a person
  // calls it, "the Force Dimension SDK (libdrd.so.3)".
  MakerLibrary(const char* wanted, std::initializer_list<std::string> names);

  const std::string& path() const noexcept { return path_; }  // of its file

  // A function of the library. optional: null where it has none of this name.
  template <class Function>
  void find(Function*& out, const char* name) const {
    out = reinterpret_cast<Function*>(symbol(name));
  }
  template <class Function>
  void find_optional(Function*& out, const char* name) const noexcept {
    out = reinterpret_cast<Function*>(symbol_or_null(name));
  }

 private:
  void* symbol(const char* name) const;
  void* symbol_or_null(const char* name) const noexcept;

  void* handle_ = nullptr;
  std::string path_;
};

}  // namespace fs
