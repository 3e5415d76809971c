// What a client asks for that may be long, of all objects of some scenes: a sealed file of records. A long one is written
// by the worker: on the server's thread all others would wait.
#pragma once

#include <string>
#include <vector>

#include "ipc/blob.h"
#include "transfer/wire.h"

namespace fs {

class List {
 public:
  virtual ~List() = default;
  virtual size_t most() const = 0;  // records

  void make() noexcept;             // any thread, once

  // Then:
  Descriptor data;
  wire::Count count{0};
  fs_status status = FS_OK;
  std::string text;

 protected:
  virtual void write() = 0;   // calls add_record for each; may throw
  virtual void release() {}   // lets go of the scenes
  template <class Record>
  void add_record(const Record& record) {
    const std::span<const std::byte> bytes = bytes_of(&record, 1);
    piece_.insert(piece_.end(), bytes.begin(), bytes.end());
    ++count.count;
    if (piece_.size() >= 65536) flush();
  }

 private:
  void flush();
  std::vector<std::byte> piece_;
  BlobWriter* blob_ = nullptr;
};

}  // namespace fs
