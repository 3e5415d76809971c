// Converts between objects and motions and their records (wire.h). Motions are checked here, as nothing that comes from
// another process is trusted; objects are checked where they are set.
#pragma once

#include <cstddef>
#include <optional>

#include "field/motion.h"
#include "field/object.h"
#include "transfer/batch.h"
#include "transfer/sizes.h"
#include "transfer/wire.h"

namespace fs {

using wire::from_record;  // of objects: contract.h
using wire::to_record;
wire::Motion to_record(const Motion& motion);
Motion from_record(const wire::Motion& record);                         // INVALID
bool from_record(const wire::Motion& record, Motion& motion) noexcept;  // the same without a sentence

// Applies a change of the frame, the clutch or the tool to a view, before the scene has it.
void foresee(fs_view& view, const Change& change);

}  // namespace fs
