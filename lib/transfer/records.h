// Between the things of a scene and the records that go from process to process (wire.h). What comes in is checked as
// if it came from anybody; objects are checked where they are set.
#pragma once

#include "base/text.h"
#include "ipc/blob.h"
#include "scene/local_scene.h"
#include "transfer/wire.h"

namespace fs {

// All but the ids of shape and curves.
wire::Object to_record(const fs_object& object);
// The handles are null.
fs_object from_record(const wire::Object& record);

// A shape or curve with what does not fit in its record. IO, FULL.
wire::Shape to_record(const Shape& shape, Descriptor& data);
wire::Curve to_record(const Curve& curve, Descriptor& data);  // data: of a table

// How many bytes come with a record. INVALID: no good record.
uint64_t data_size(const wire::Shape& record);
uint64_t data_size(const wire::Curve& record);
// INVALID, PARSE, UNSUPPORTED, IO. data is closed when it has been read.
Ref<const Shape> from_record(const wire::Shape& record, Descriptor data, Wanted& wanted);  // throws Abandoned, too
inline Ref<const Shape> from_record(const wire::Shape& record, Descriptor data) {
  Wanted wanted;
  return from_record(record, std::move(data), wanted);
}
Ref<const Curve> from_record(const wire::Curve& record, Descriptor data);

wire::Movement to_record(const Motion& motion);
Motion from_record(const wire::Movement& record);                         // INVALID
bool from_record(const wire::Movement& record, Motion& motion) noexcept;  // the same without a sentence

// What a change of the frame, the clutch or the tool that has not been done yet makes of a view.
void foresee(fs_view& view, wire::Type type, std::span<const std::byte> record);

}  // namespace fs
