// Large data between processes: a memory file that is written once, sealed, and sent as a descriptor. A file that could still
// change, shrink or block is refused.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>

#include "base/descriptor.h"

namespace fs {

// Writes such a file part by part. IO; FULL: no descriptor is left.
class BlobWriter {
 public:
  BlobWriter();
  void write(std::span<const std::byte> part);
  Descriptor seal();  // ends the file

 private:
  Descriptor blob_;
};

// A sealed file of the parts, one after the other. IO; FULL: no descriptor is left.
Descriptor make_blob(std::initializer_list<std::span<const std::byte>> parts);

// Throws INVALID unless it is a sealed memory file of exactly so many bytes.
void check_blob(const Descriptor& blob, uint64_t bytes);
// Fills `out` with the bytes from `offset` on. IO.
void read_blob(const Descriptor& blob, uint64_t offset, std::span<std::byte> out);

// Maps a sealed file of so many bytes (> 0) into this process, without copying it. INVALID, IO.
std::shared_ptr<const void> map_blob(const Descriptor& blob, uint64_t bytes);

template <class T>
std::span<const std::byte> bytes_of(const T* data, size_t count) {
  return std::as_bytes(std::span<const T>(data, count));
}

}  // namespace fs
