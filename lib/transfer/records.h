// Between the things of a scene and the records that go from process to process (wire.h). Motions that come in are checked
// here, as if they came from anybody; objects are checked where they are set.
#pragma once

#include <cstddef>
#include <optional>

#include "scene/object.h"
#include "scene/motion.h"
#include "transfer/batch.h"
#include "transfer/wire.h"

namespace fs {

// Of the record that comes with a type of message; nothing: there is no such type. Of a group it is not told here.
std::optional<size_t> record_size(uint32_t type) noexcept;

// All but the ids of shape and curves.
wire::Object to_record(const fs_object& object);
// The handles are null.
fs_object from_record(const wire::Object& record);

wire::Movement to_record(const Motion& motion);
Motion from_record(const wire::Movement& record);                         // INVALID
bool from_record(const wire::Movement& record, Motion& motion) noexcept;  // the same without a sentence

// What a change of the frame, the clutch or the tool that has not been applied yet makes of a view.
void foresee(fs_view& view, const Change& change);

}  // namespace fs
